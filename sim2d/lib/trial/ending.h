// Criteria on the car's state that end a trial: goal reached, tipped, off course, stuck. Time-outs and faults come from
// the firmware.
#pragma once

#include <optional>

#include "scene_spec.h"
#include "supervisor.h"
#include "trial.h"
#include "sim_car.h"

namespace foldcar {

// Tipped: the car's up axis leans by more than 75 degrees, so that its vertical component is below this.
constexpr double kTippedUp = 0.26;
// Stuck: within this time the car has neither moved by this distance nor turned by this angle.
constexpr double kStuckDistance_m = 0.010;
constexpr double kStuckTurn_rad = 0.035;
constexpr double kStuckTime_s = 4;
// Also stuck: within this longer time the car has not moved by this distance, though it may have rocked and turned. This
// does not hold for a car whose command is to turn in a smaller circle. In the width study, no run that passed stayed within
// this distance for a second.
constexpr double kCaughtDistance_m = 0.05;
constexpr double kCaughtTime_s = 8;

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
  const bool would_leave_;  // whether an unobstructed car would move farther than kCaughtDistance_m
  bool was_short_of_goal_;
  // The state, and its time, when the car had last moved by kStuckDistance_m or turned by kStuckTurn_rad.
  CarState last_moved_;
  double last_moved_s_ = 0;
  // The state, and its time, when the car had last moved by kCaughtDistance_m.
  CarState last_left_;
  double last_left_s_ = 0;
};

// Distance in the ground plane from the car's origin to the goal's point; none if the scene has no goal.
std::optional<double> distance_to_target_m(const SceneSpec& scene, const CarState& state);

}  // namespace foldcar
