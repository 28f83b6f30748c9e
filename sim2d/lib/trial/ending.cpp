#include "ending.h"

#include <cmath>

#include "elementary_functions.h"

namespace foldcar {

std::optional<double> distance_to_target_m(const SceneSpec& scene, const CarState& state) {
  if (!scene.goal) return std::nullopt;
  return hypotenuse(state.x_m - scene.goal->x_m, state.y_m - scene.goal->y_m);
}

namespace {

double distance_m(const CarState& a, const CarState& b) { return hypotenuse(a.x_m - b.x_m, a.y_m - b.y_m); }

}  // namespace

// would_leave_: whether the set-point's circle, of radius speed / yaw rate, is larger than kCaughtDistance_m, so that
// a car that stays within that distance is caught.
Ending::Ending(const SceneSpec& scene, const CarState& start, const TrialRequest& trial)
    : scene_(scene),
      would_leave_(std::abs(trial.speed_m_s) > kCaughtDistance_m * std::abs(trial.yaw_rate_rad_s)),
      was_short_of_goal_(short_of_goal(start)),
      last_moved_(start),
      last_left_(start) {}

// Whether the car is still outside the goal's disc or before the goal's line; always true without a goal.
bool Ending::short_of_goal(const CarState& state) const {
  if (!scene_.goal) return true;
  const GoalSpec& goal = *scene_.goal;
  const double dx = goal.x_m - state.x_m, dy = goal.y_m - state.y_m;
  if (goal.kind == GoalSpec::Kind::kDisc) return hypotenuse(dx, dy) - goal.radius_m > 0;
  return dx * cosine(goal.heading_rad) + dy * sine(goal.heading_rad) > 0;
}

// Returns how the trial has ended, if it has: tipped, goal passed, off the course, or stuck, which is to stay within
// kCaughtDistance_m for kCaughtTime_s or within kStuckDistance_m and kStuckTurn_rad for kStuckTime_s.
std::optional<Outcome> Ending::check(const CarState& state, double elapsed_s) {
  if (state.up < kTippedUp) return Outcome::kTipped;
  const bool still_short = short_of_goal(state);
  if (was_short_of_goal_ && !still_short) return Outcome::kPassed;
  was_short_of_goal_ = still_short;
  const CourseSpec& course = scene_.course;
  if (state.x_m < course.x_min_m || state.x_m > course.x_max_m || state.y_m < course.y_min_m ||
      state.y_m > course.y_max_m) {
    return Outcome::kOffCourse;
  }
  if (distance_m(state, last_left_) > kCaughtDistance_m) {
    last_left_ = state;
    last_left_s_ = elapsed_s;
  } else if (would_leave_ && elapsed_s - last_left_s_ >= kCaughtTime_s) {
    return Outcome::kStuck;
  }
  if (distance_m(state, last_moved_) > kStuckDistance_m || std::abs(state.heading_rad - last_moved_.heading_rad) > kStuckTurn_rad) {
    last_moved_ = state;
    last_moved_s_ = elapsed_s;
  } else if (elapsed_s - last_moved_s_ >= kStuckTime_s) {
    return Outcome::kStuck;
  }
  return std::nullopt;
}

}  // namespace foldcar
