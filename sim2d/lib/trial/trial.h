// One trial: a car with its firmware, created in a scene, armed, started and driven to its end.
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
#include "engine.h"
#include "metrics.h"
#include "outcome.h"
#include "parameters.h"
#include "program_run.h"
#include "scene_spec.h"
#include "scoped_timer.h"

namespace foldcar {

// Settings of a trial.
struct TrialSpec {
  double speed_m_s = 0;
  double yaw_rate_rad_s = 0;
  double time_limit_s = 0;
  double path_interval_s = 0;  // time between the rows of the path; 0: no path
  Parameters parameters;
};

// time, x, y, z (of the car's origin), heading, pitch, roll, then the angle of each hinge from front to back
using PathRow = std::vector<double>;

// The metrics at the end, how it ended, what the scene's program recorded and, if it was asked for, the path.
struct TrialResult : Metrics {
  Outcome outcome = Outcome::kTimeout;
  std::vector<Recorded> recorded;
  std::vector<PathRow> path;
};

// The firmware refused the trial, or a state of the simulation is not a finite number; the message says which.
class TrialError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

// A trial at one of its steps: the metrics until then and the state of the car.
struct Snapshot : Metrics {
  CarState car;
};

// The result of a trial that ended at that moment in that way; without a path.
TrialResult result_at(const Snapshot& at, Outcome outcome);

// A trial that its caller advances. All arguments must outlive it. terrain is the scene's; if it is null the trial
// makes its own.
class Trial {
 public:
  // Puts the car down, lets it come to rest and starts it. Throws TrialError.
  Trial(const Engine& engine, const BodySpec& body, const SceneSpec& scene, const TrialSpec& spec,
        Stopwatch* stopwatch = nullptr, const Terrain* terrain = nullptr);
  ~Trial();

  // Advances by one step; not to be called once there is an outcome. Throws TrialError.
  void step();
  // The outcome, once the state is one that ends the trial.
  std::optional<Outcome> outcome() const { return outcome_; }
  const Snapshot& now() const { return now_; }
  double step_s() const;
  double hinge_rad(std::size_t hinge) const;
  // What the scene's program has recorded.
  const std::vector<Recorded>& recorded() const { return program_->recorded(); }

 private:
  class Simulation;

  // Takes the state after a step into the snapshot, and sees whether it ends the trial.
  void observe();

  const SceneSpec& scene_;
  std::unique_ptr<Simulation> simulation_;
  std::optional<ProgramRun> program_;  // from the start of the trial on
  double start_s_ = 0;
  double start_energy_j_ = 0;
  Snapshot now_;
  std::optional<Outcome> outcome_;
};

// Runs a trial to its end. Arguments as of Trial. Throws TrialError.
TrialResult run_trial(const Engine& engine, const BodySpec& body, const SceneSpec& scene, const TrialSpec& trial,
                      Stopwatch* stopwatch = nullptr, const Terrain* terrain = nullptr);

}  // namespace foldcar
