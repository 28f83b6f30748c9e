// One trial: a car with its firmware, put down in a scene, armed, started and driven to its end.
//
// Input: body, scene, firmware parameters, set-point and time limit. Output: how it ended and what it took.
// A pure function of its input; many trials may run in one process, one after the other.
#pragma once

#include <array>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "body_spec.h"
#include "parameters.h"
#include "scene_spec.h"
#include "stopwatch.h"
#include "twin_track_car.h"

namespace foldcar {

enum class Outcome { kPassed, kTipped, kStuck, kOffCourse, kTimeout, kFault };
const char* text(Outcome outcome);

struct TrialSpec {
  double speed_m_s = 0;
  double yaw_rate_rad_s = 0;
  double time_limit_s = 0;
  double path_interval_s = 0;  // 0: no path
  Parameters parameters;
};

// time, x, y, z (of the car's origin), heading, pitch, roll
using PathRow = std::array<double, 7>;

struct TrialResult {
  Outcome outcome = Outcome::kTimeout;
  double elapsed_time_s = 0;
  std::optional<double> distance_to_target_m;  // none without a goal
  double consumed_energy_j = 0;
  double max_roll_rad = 0;
  double max_pitch_rad = 0;
  std::vector<PathRow> path;
};

// The firmware would not start the trial, or the simulation left the finite numbers; the message says why.
class TrialError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

TrialResult run_trial(const BodySpec& body, const SceneSpec& scene, const TrialSpec& trial,
                      const StepOptions& options = {}, Stopwatch* stopwatch = nullptr);

}  // namespace foldcar
