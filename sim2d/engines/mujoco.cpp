#include "../src/built_engine.h"
#include "mujoco_engine.h"

namespace foldcar {
namespace {

// How far results depend on step and tyre tells how far one may ask multibody to agree.
MujocoOptions& options() {
  static MujocoOptions chosen;
  return chosen;
}

}  // namespace

const char* const kEngineUsage =
    "before the command:\n"
    "       --half-step                          half MuJoCo's time step\n"
    "       --ellipsoid-tyres                    tyres as ellipsoids instead of cylinders\n";

const Engine& engine() {
  static const MujocoEngine built(options());
  return built;
}

bool take_engine_option(const std::string& word) {
  if (word == "--half-step") {
    options().step_s = MujocoOptions().step_s / 2;
  } else if (word == "--ellipsoid-tyres") {
    options().tyre = TyreShape::kEllipsoid;
  } else {
    return false;
  }
  return true;
}

}  // namespace foldcar
