#include "../src/built_engine.h"
#include "multibody_engine.h"

namespace foldcar {

const Engine& engine() {
  static const MultibodyEngine built;
  return built;
}

bool take_engine_option(const std::string&) { return false; }

}  // namespace foldcar
