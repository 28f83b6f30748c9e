// One trial: a car with its firmware, put down in a scene, armed, started and driven to its end.
//
// Input: body, scene, firmware parameters, set-point and time limit. Output: how it ended and what it took, or,
// step by step, where the car is. A pure function of its input; many trials may run in one process.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
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

// kTerminated: the caller ended the trial. It alone never comes from the trial itself.
enum class Outcome { kPassed, kTipped, kStuck, kOffCourse, kTimeout, kFault, kTerminated };
const char* text(Outcome outcome);

struct TrialSpec {
  double speed_m_s = 0;
  double yaw_rate_rad_s = 0;
  double time_limit_s = 0;
  double path_interval_s = 0;  // 0: no path
  Parameters parameters;
};

// time, x, y, z (of the car's origin), heading, pitch, roll, then the angle of each hinge from front to back
using PathRow = std::vector<double>;

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

// What is known of a trial at one of its steps.
struct Snapshot {
  double elapsed_time_s = 0;
  CarState car;
  double consumed_energy_j = 0;  // since the start of the trial
  double max_roll_rad = 0;       // until now
  double max_pitch_rad = 0;
};

// A trial that its caller advances. Everything handed over must outlive it. terrain is the scene's; without one the
// trial makes it.
class Trial {
 public:
  // Puts the car down, lets it come to rest and starts it. Throws TrialError.
  Trial(const BodySpec& body, const SceneSpec& scene, const TrialSpec& spec, const StepOptions& options = {},
        Stopwatch* stopwatch = nullptr, const Terrain* terrain = nullptr);
  ~Trial();

  // Advances by one step; not to be called once there is an outcome. Throws TrialError.
  void step();
  // The outcome, once the state is one that ends the trial.
  std::optional<Outcome> outcome() const { return outcome_; }
  const Snapshot& now() const { return now_; }
  double step_s() const;
  double hinge_rad(std::size_t hinge) const;
  // The result of a trial that ended at that moment in that way; without a path.
  TrialResult result(const Snapshot& at, Outcome outcome) const;

 private:
  class Simulation;

  void look();

  const SceneSpec& scene_;
  std::unique_ptr<Simulation> simulation_;
  double start_s_ = 0;
  double start_energy_j_ = 0;
  Snapshot now_;
  std::optional<Outcome> outcome_;
};

// A whole trial at once.
TrialResult run_trial(const BodySpec& body, const SceneSpec& scene, const TrialSpec& trial,
                      const StepOptions& options = {}, Stopwatch* stopwatch = nullptr, const Terrain* terrain = nullptr);

}  // namespace foldcar
