// The engines of carsim: multibody, or after the word --side-view Box2D's.
#include "../src/built_engine.h"
#include "multibody_engine.h"
#include "side_view_engine.h"

namespace foldcar {
namespace {

bool& in_side_view() {
  static bool chosen = false;
  return chosen;
}

}  // namespace

const char* const kEngineUsage =
    "before the command:\n"
    "       --side-view                          Box2D in the car's side plane instead of multibody\n";

const Engine& engine() {
  static const MultibodyEngine multibody;
  static const SideViewEngine side_view;
  if (in_side_view()) return side_view;
  return multibody;
}

bool take_engine_option(const std::string& word) {
  if (word != "--side-view") return false;
  in_side_view() = true;
  return true;
}

}  // namespace foldcar
