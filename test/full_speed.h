// Settings of a trial of the study car at full speed, with a path.
#pragma once

#include "trial.h"

namespace foldcar {

inline TrialSpec full_speed(const BodySpec& body, double time_limit_s = 60) {
  TrialSpec trial;
  trial.speed_m_s = 0.69;
  trial.time_limit_s = time_limit_s;
  trial.path_interval_s = 0.05;
  trial.parameters.set("TRACK_M", static_cast<float>(body.track_m));
  return trial;
}

}  // namespace foldcar
