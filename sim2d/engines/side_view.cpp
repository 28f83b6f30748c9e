#include "../src/built_engine.h"
#include "side_view_engine.h"

namespace foldcar {

const Engine& engine() {
  static const SideViewEngine built;
  return built;
}

bool take_engine_option(const std::string&) { return false; }

}  // namespace foldcar
