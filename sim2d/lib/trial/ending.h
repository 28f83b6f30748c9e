// Criteria on the car's state that end a trial: goal reached, tipped, off course, stuck. Time-outs and faults come from
// the firmware.
#pragma once

#include <optional>

#include "scene_spec.h"
#include "supervisor.h"
#include "trial.h"
#include "sim_car.h"

namespace foldcar {

// Tipped: the upward part of the car's up axis is below this, the cosine of 75 degrees.
constexpr double kTippedUp = 0.26;
// Stuck: neither this far away nor turned by this much within the time.
constexpr double kStuckDistance_m = 0.010;
constexpr double kStuckTurn_rad = 0.035;
constexpr double kStuckTime_s = 4;
// Stuck as well: not this far away within the time, however much it turned and rocked meanwhile, unless it was told to
// turn in less room. Of the study's runs that passed none stayed there for a second.
constexpr double kHeldDistance_m = 0.05;
constexpr double kHeldTime_s = 8;

// Watches one trial.
class Ending {
 public:
  // start: the state at the start of the trial. scene must outlive it.
  Ending(const SceneSpec& scene, const CarState& start, const TrialRequest& trial);

  // The outcome if the state at elapsed_s of the trial ends it. To be called at every step.
  std::optional<Outcome> check(const CarState& state, double elapsed_s);

 private:
  bool short_of_goal(const CarState& state) const;

  const SceneSpec& scene_;
  const bool leaves_;  // whether a free car would get farther away than kHeldDistance_m
  bool was_short_of_goal_;
  CarState moved_at_;
  double moved_at_s_ = 0;
  CarState left_at_;
  double left_at_s_ = 0;
};

// Distance in the ground plane from the car's origin to the goal's point; none if the scene has no goal.
std::optional<double> distance_to_target_m(const SceneSpec& scene, const CarState& state);

}  // namespace foldcar
