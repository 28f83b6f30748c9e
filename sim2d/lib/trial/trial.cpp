#include "trial.h"

#include <algorithm>
#include <cmath>

#include "application.h"
#include "box_terrain.h"
#include "ending.h"
#include "sim_hal.h"
#include "trial_start.h"

namespace foldcar {
namespace {

// The firmware and the car, stepped together: the application ticks whenever its period has passed.
class CoSimulation {
 public:
  CoSimulation(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain, const Parameters& parameters,
               const StepOptions& options, Stopwatch* stopwatch)
      : stopwatch_(stopwatch),
        parameters_(parameters),
        hal_(kLogicBattery_v),
        application_(hal_.hal(), parameters_),
        car_(body, scene.friction, terrain, scene.start, options, stopwatch) {
    application_.begin();
  }

  void step() {
    if (hal_.clock.now_us() >= next_tick_us_) {
      const Lap lap(stopwatch_ != nullptr ? &stopwatch_->firmware_s : nullptr);
      application_.tick();
      next_tick_us_ += kTickUs;
    }
    car_.step(hal_.servos.pulses_us());
    ++steps_;
    hal_.clock.advance_to_us(to_us(static_cast<double>(steps_) * car_.step_s()));
    if (!car_.finite()) throw TrialError("the simulation left the finite numbers");
  }

  double now_s() const { return static_cast<double>(steps_) * car_.step_s(); }
  Application& application() { return application_; }
  const CarState& state() const { return car_.state(); }

 private:
  Stopwatch* stopwatch_;
  Parameters parameters_;
  SimHal hal_;
  Application application_;
  TwinTrackCar car_;
  std::uint64_t next_tick_us_ = 0;
  std::uint64_t steps_ = 0;
};

PathRow path_row(double t_s, const CarState& state) {
  return {t_s, state.x_m, state.y_m, state.z_m, state.heading_rad, state.pitch_rad, state.roll_rad};
}

}  // namespace

const char* text(Outcome outcome) {
  switch (outcome) {
    case Outcome::kPassed: return "passed";
    case Outcome::kTipped: return "tipped";
    case Outcome::kStuck: return "stuck";
    case Outcome::kOffCourse: return "off_course";
    case Outcome::kTimeout: return "timeout";
    case Outcome::kFault: return "fault";
  }
  return "fault";
}

TrialResult run_trial(const BodySpec& body, const SceneSpec& scene, const TrialSpec& trial,
                      const StepOptions& options, Stopwatch* stopwatch) {
  const BoxTerrain terrain(scene.boxes);
  CoSimulation simulation(body, scene, terrain, trial.parameters, options, stopwatch);
  Application& application = simulation.application();
  while (simulation.now_s() < kSettling_s) simulation.step();
  start_firmware(application, trial);
  const double start_s = simulation.now_s();
  const double start_energy_j = simulation.state().consumed_energy_j;
  Ending ending(scene, simulation.state());
  TrialResult result;
  double next_path_s = 0;
  for (;;) {
    const CarState& state = simulation.state();
    const double elapsed_s = simulation.now_s() - start_s;
    result.max_roll_rad = std::max(result.max_roll_rad, std::abs(state.roll_rad));
    result.max_pitch_rad = std::max(result.max_pitch_rad, std::abs(state.pitch_rad));
    std::optional<Outcome> outcome = ending.check(state, elapsed_s);
    const Status status = application.status();
    if (!outcome && status.state == State::kFault) outcome = Outcome::kFault;
    if (!outcome && status.state == State::kFinished) outcome = Outcome::kTimeout;
    if (trial.path_interval_s > 0 && (outcome || elapsed_s >= next_path_s - 1e-9)) {
      result.path.push_back(path_row(elapsed_s, state));
      next_path_s += trial.path_interval_s;
    }
    if (outcome) {
      result.outcome = *outcome;
      result.elapsed_time_s = elapsed_s;
      result.distance_to_target_m = distance_to_target_m(scene, state);
      result.consumed_energy_j = state.consumed_energy_j - start_energy_j;
      return result;
    }
    simulation.step();
  }
}

}  // namespace foldcar
