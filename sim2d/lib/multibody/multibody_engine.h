// The car in six degrees of freedom as an engine of trials.
#pragma once

#include "engine.h"
#include "multibody_car.h"

namespace foldcar {

class MultibodyEngine : public Engine {
 public:
  explicit MultibodyEngine(const StepOptions& options = {}) : options_(options) {}
  std::string name() const override { return "multibody"; }
  double step_s() const override { return 1 / options_.rate_hz; }
  std::unique_ptr<SimCar> create_car(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                                     Stopwatch* stopwatch) const override {
    return std::make_unique<MultibodyCar>(body, scene.friction, terrain, scene.start, options_, stopwatch);
  }

 private:
  const StepOptions options_;
};

}  // namespace foldcar
