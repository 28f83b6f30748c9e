// Trials in the side view, for the tests of the simulator.
#pragma once

#include "side_view_engine.h"
#include "trial.h"

namespace foldcar {

inline TrialResult run_trial(const BodySpec& body, const SceneSpec& scene, const TrialSpec& trial,
                             const StepOptions& options = {}, Stopwatch* stopwatch = nullptr,
                             const Terrain* terrain = nullptr) {
  return run_trial(SideViewEngine(options), body, scene, trial, stopwatch, terrain);
}

}  // namespace foldcar
