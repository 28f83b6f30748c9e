// When a trial is over: goal reached, tipped, off course or stuck. Time-outs and faults are the firmware's.
#pragma once

#include <optional>

#include "scene_spec.h"
#include "trial.h"
#include "twin_track_car.h"

namespace foldcar {

// Tipped: the upward part of the car's up axis is below this, the cosine of 75 degrees.
constexpr double kTippedUp = 0.26;
// Stuck: neither this far away nor turned by this much within the time.
constexpr double kStuckDistance_m = 0.010;
constexpr double kStuckTurn_rad = 0.035;
constexpr double kStuckTime_s = 4;

class Ending {
 public:
  Ending(const SceneSpec& scene, const CarState& start);

  // The outcome if state, elapsed_s into the trial, ends it.
  std::optional<Outcome> check(const CarState& state, double elapsed_s);

 private:
  bool short_of_goal(const CarState& state) const;

  const SceneSpec& scene_;
  bool was_short_of_goal_;
  CarState moved_at_;
  double moved_at_s_ = 0;
};

// None if the scene has no goal.
std::optional<double> distance_to_target_m(const SceneSpec& scene, const CarState& state);

}  // namespace foldcar
