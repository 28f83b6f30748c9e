// What moves simulated cars: Box2D in the side view, multibody in six degrees of freedom, or MuJoCo.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>

#include "body_spec.h"
#include "scene_spec.h"
#include "scoped_timer.h"
#include "sim_car.h"
#include "terrain.h"

namespace foldcar {

// An engine has no state that runs could share: the same arguments give the same car.
class Engine {
 public:
  virtual ~Engine() = default;
  // Its name, with a space its version where that is not the build's, and after commas how it was chosen to differ.
  virtual std::string name() const = 0;
  // Length of its steps.
  virtual double step_s() const = 0;
  // Creates the car at the scene's start, at rest, wheels just above the ground. terrain is the scene's; body,
  // scene, terrain and stopwatch (may be null) must outlive the car. Throws std::runtime_error for what it cannot model.
  virtual std::unique_ptr<SimCar> create_car(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                                             Stopwatch* stopwatch) const = 0;
  // The car in the scene, as MuJoCo's XML. Throws std::runtime_error of an engine that has no such model.
  virtual std::string mjcf(const BodySpec&, const SceneSpec&, const Terrain&, const std::string& /*name*/) const {
    throw std::runtime_error("mjcf: this program's engine is not MuJoCo");
  }
};

}  // namespace foldcar
