// Box2D's car in its side plane as an engine of trials.
#pragma once

#include "engine.h"
#include "side_view_car.h"

namespace foldcar {

class SideViewEngine : public Engine {
 public:
  explicit SideViewEngine(const SideViewOptions& options = {}) : options_(options) {}
  std::string name() const override { return "side-view"; }
  double step_s() const override { return 1 / options_.rate_hz; }
  std::unique_ptr<SimCar> create_car(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                                     Stopwatch* stopwatch) const override {
    return std::make_unique<SideViewCar>(body, scene, terrain, options_, stopwatch);
  }

 private:
  const SideViewOptions options_;
};

}  // namespace foldcar
