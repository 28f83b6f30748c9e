// Cars and trials in multibody.
#pragma once

#include "../closed_form_tests.h"
#include "multibody_car.h"
#include "multibody_engine.h"
#include "trial.h"

namespace foldcar {

using Drive = DriveOf<MultibodyCar, StepOptions>;

inline const SceneSpec kFlat = scene_of({}, 0.6);

inline StepOptions gently(double rate_hz = 240) { return create_gently<StepOptions>(rate_hz); }

inline TrialResult run_trial(const BodySpec& body, const SceneSpec& scene, const TrialSpec& trial,
                             const StepOptions& options = {}, Stopwatch* stopwatch = nullptr,
                             const Terrain* terrain = nullptr) {
  return run_trial(MultibodyEngine(options), body, scene, trial, stopwatch, terrain);
}

}  // namespace foldcar
