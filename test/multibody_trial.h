// Trials in multibody, for the tests of the simulator.
#pragma once

#include "multibody_engine.h"
#include "trial.h"

namespace foldcar {

inline TrialResult run_trial(const BodySpec& body, const SceneSpec& scene, const TrialSpec& trial,
                             const StepOptions& options = {}, Stopwatch* stopwatch = nullptr,
                             const Terrain* terrain = nullptr) {
  return run_trial(MultibodyEngine(options), body, scene, trial, stopwatch, terrain);
}

}  // namespace foldcar
