#include "trial.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "application.h"
#include "ending.h"
#include "scene_terrain.h"
#include "sim_hal.h"
#include "trial_start.h"

namespace foldcar {
namespace {

// One row of a path: time, x, y, z, heading, pitch, roll, then every hinge's angle.
PathRow path_row(const Trial& trial, std::size_t hinges) {
  const CarState& car = trial.now().car;
  PathRow row = {trial.now().elapsed_time_s, car.x_m, car.y_m, car.z_m, car.heading_rad, car.pitch_rad, car.roll_rad};
  for (std::size_t hinge = 0; hinge < hinges; ++hinge) row.push_back(trial.hinge_rad(hinge));
  return row;
}

}  // namespace

// The firmware and the car, stepped together: the application ticks whenever its period has passed.
class Trial::Simulation {
 public:
  Simulation(const Engine& engine, const BodySpec& body, const SceneSpec& scene, const Terrain* terrain,
             const Parameters& parameters, Stopwatch* stopwatch)
      : stopwatch_(stopwatch),
        step_s_(engine.step_s()),
        parameters_(parameters),
        hal_(kLogicBattery_v),
        application_(hal_.hal(), parameters_),
        own_terrain_(terrain == nullptr ? std::make_unique<const SceneTerrain>(scene.terrain) : nullptr),
        car_(engine.create_car(body, scene, terrain == nullptr ? *own_terrain_ : *terrain, stopwatch)) {
    application_.begin();
  }

  void step() {
    if (hal_.clock.now_us() >= next_tick_us_) {
      const ScopedTimer timer(stopwatch_ != nullptr ? &stopwatch_->firmware_s : nullptr);
      application_.tick();
      next_tick_us_ += kTickUs;
    }
    car_->step(hal_.servos.pulses_us());
    ++steps_;
    hal_.clock.advance_to_us(to_us(static_cast<double>(steps_) * step_s_));
    if (!car_->finite()) throw TrialError("the simulation left the finite numbers");
  }

  double now_s() const { return static_cast<double>(steps_) * step_s_; }
  double step_s() const { return step_s_; }
  double hinge_rad(std::size_t hinge) const { return car_->hinge_rad(hinge); }
  Application& application() { return application_; }
  const CarState& state() const { return car_->state(); }
  std::optional<Ending> ending;  // from the start of the trial on

 private:
  Stopwatch* stopwatch_;
  const double step_s_;
  Parameters parameters_;
  SimHal hal_;
  Application application_;
  std::unique_ptr<const SceneTerrain> own_terrain_;
  std::unique_ptr<SimCar> car_;
  std::uint64_t next_tick_us_ = 0;
  std::uint64_t steps_ = 0;
};

const char* text(Outcome outcome) {
  switch (outcome) {
    case Outcome::kPassed: return "passed";
    case Outcome::kTipped: return "tipped";
    case Outcome::kStuck: return "stuck";
    case Outcome::kOffCourse: return "off_course";
    case Outcome::kTimeout: return "timeout";
    case Outcome::kFault: return "fault";
    case Outcome::kTerminated: return "terminated";
  }
  return "fault";
}

// Lets the car settle, starts the firmware's trial, and observes its first state.
Trial::Trial(const Engine& engine, const BodySpec& body, const SceneSpec& scene, const TrialSpec& spec,
             Stopwatch* stopwatch, const Terrain* terrain)
    : scene_(scene),
      simulation_(std::make_unique<Simulation>(engine, body, scene, terrain, spec.parameters, stopwatch)) {
  Simulation& simulation = *simulation_;
  while (simulation.now_s() < kSettling_s) simulation.step();
  start_firmware(simulation.application(), spec);
  start_s_ = simulation.now_s();
  start_energy_j_ = simulation.state().consumed_energy_j;
  simulation.ending.emplace(scene_, simulation.state(), simulation.application().trial());
  program_.emplace(scene_.program, simulation.state());
  observe();
}

Trial::~Trial() = default;

double Trial::step_s() const { return simulation_->step_s(); }

double Trial::hinge_rad(std::size_t hinge) const { return simulation_->hinge_rad(hinge); }

void Trial::step() {
  simulation_->step();
  observe();
}

// Reads the state after a step and decides whether the trial has ended. The simulator's endings (tipped, passed, …)
// come before the firmware's (fault, time-out), and these before the program's.
void Trial::observe() {
  const CarState& car = simulation_->state();
  now_.elapsed_time_s = simulation_->now_s() - start_s_;
  now_.car = car;
  now_.distance_to_target_m = distance_to_target_m(scene_, car);
  now_.consumed_energy_j = car.consumed_energy_j - start_energy_j_;
  now_.max_roll_rad = std::max(now_.max_roll_rad, std::abs(car.roll_rad));
  now_.max_pitch_rad = std::max(now_.max_pitch_rad, std::abs(car.pitch_rad));
  outcome_ = simulation_->ending->check(car, now_.elapsed_time_s);
  const Status status = simulation_->application().status();
  if (!outcome_ && status.state == State::kFault) outcome_ = Outcome::kFault;
  if (!outcome_ && status.state == State::kFinished) outcome_ = Outcome::kTimeout;
  if (!outcome_) outcome_ = program_->check(car, now_.elapsed_time_s);
  program_->record(car, now_.elapsed_time_s, outcome_.has_value());
}

TrialResult result_at(const Snapshot& at, Outcome outcome) {
  TrialResult result;
  static_cast<Metrics&>(result) = at;
  result.outcome = outcome;
  return result;
}

// Runs a trial to its end. Its path has a row every path_interval_s and one at the end; none if the interval is 0.
TrialResult run_trial(const Engine& engine, const BodySpec& body, const SceneSpec& scene, const TrialSpec& spec,
                      Stopwatch* stopwatch, const Terrain* terrain) {
  Trial trial(engine, body, scene, spec, stopwatch, terrain);
  std::vector<PathRow> path;
  double next_path_s = 0;
  for (;;) {
    const std::optional<Outcome> outcome = trial.outcome();
    if (spec.path_interval_s > 0 && (outcome || trial.now().elapsed_time_s >= next_path_s - 1e-9)) {
      path.push_back(path_row(trial, body.hinges.size()));
      next_path_s += spec.path_interval_s;
    }
    if (outcome) {
      TrialResult result = result_at(trial.now(), *outcome);
      result.recorded = trial.recorded();
      result.path = std::move(path);
      return result;
    }
    trial.step();
  }
}

}  // namespace foldcar
