#include "pulse_record.h"

#include <cstdint>

#include "application.h"
#include "sim_hal.h"
#include "trial_start.h"

namespace foldcar {

// Runs the firmware alone, without a car, through a trial and returns every change of its servo pulses, with times
// from the trial's start (negative before it).
std::vector<PulseChange> record_pulses(const TrialSpec& trial, double step_s) {
  Parameters parameters = trial.parameters;
  SimHal hal(kLogicBattery_v);
  Application application(hal.hal(), parameters);
  application.begin();
  std::vector<PulseChange> changes;
  std::uint64_t next_tick_us = 0;
  double start_s = -1;
  for (std::uint64_t steps = 0;; ++steps) {
    const double now_s = static_cast<double>(steps) * step_s;
    hal.clock.advance_to_us(to_us(now_s));
    if (start_s < 0 && now_s >= kSettling_s) {
      start_firmware(application, trial);
      start_s = now_s;
    }
    if (hal.clock.now_us() < next_tick_us) continue;
    application.tick();
    next_tick_us += kTickUs;
    const PulsesUs& pulses_us = hal.servos.pulses_us();
    if (changes.empty() || pulses_us != changes.back().pulses_us) changes.push_back({now_s, pulses_us});
    if (start_s >= 0 && application.status().state != State::kRunning) break;
  }
  for (PulseChange& change : changes) change.t_s -= start_s;
  return changes;
}

}  // namespace foldcar
