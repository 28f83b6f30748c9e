#include "mujoco_engine.h"

#include <cstdio>
#include <cstdlib>

#include "mujoco_car.h"
#include "mujoco_xml.h"

namespace foldcar {
namespace {

// MuJoCo goes on after an error in whatever state it is if this returns.
void end(const char* message) {
  std::fprintf(stderr, "carsim: MuJoCo: %s\n", message);
  std::abort();
}

void ignore(const char*) {}

}  // namespace

MujocoEngine::MujocoEngine(const MujocoOptions& options) : options_(options) {
  mju_user_error = end;
  mju_user_warning = ignore;
}

std::string MujocoEngine::name() const {
  std::string name = std::string("MuJoCo ") + mj_versionString();
  if (options_.step_s == MujocoOptions().step_s / 2) name += ", half step";
  if (options_.tyre == TyreShape::kEllipsoid) name += ", ellipsoid tyres";
  return name;
}

std::unique_ptr<SimCar> MujocoEngine::create_car(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                                                 Stopwatch* stopwatch) const {
  return std::make_unique<MujocoCar>(body, scene, terrain, options_, stopwatch);
}

std::string MujocoEngine::mjcf(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                               const std::string& name) const {
  return mujoco_xml(body, scene, terrain, options_, name);
}

}  // namespace foldcar
