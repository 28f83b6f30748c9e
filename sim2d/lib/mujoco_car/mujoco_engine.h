// MuJoCo as an engine of trials.
#pragma once

#include "engine.h"
#include "mujoco_model.h"

namespace foldcar {

class MujocoEngine : public Engine {
 public:
  // Error messages of MuJoCo go to standard error, its warnings and log file nowhere.
  explicit MujocoEngine(const MujocoOptions& options = {});
  std::string name() const override;
  double step_s() const override { return options_.step_s; }
  std::unique_ptr<SimCar> create_car(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                                     Stopwatch* stopwatch) const override;
  std::string mjcf(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                   const std::string& name) const override;

 private:
  const MujocoOptions options_;
};

}  // namespace foldcar
