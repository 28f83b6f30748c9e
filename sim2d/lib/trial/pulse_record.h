// The servo pulses of the firmware in a trial, without a simulated car. The firmware reads no sensor but its own
// battery, so its pulses are a function of the settings alone.
//
// Input: set-point, time limit and parameters. Output: the pulse widths at every change. The clock advances by the
// simulator's steps, so the times are those of a run.
#pragma once

#include <vector>

#include "hal.h"
#include "trial.h"

namespace foldcar {

// A moment at which the pulse widths (µs) change, and what they are from then on.
struct PulseChange {
  double t_s = 0;  // since the start of the trial; the first is negative: when the car is created
  PulsesUs pulses_us{};
};

// step_s: the length of the simulator's steps. The changes up to and including the tick at which the firmware ends the trial. TrialError if it refuses to start it.
std::vector<PulseChange> record_pulses(const TrialSpec& trial, double step_s);

}  // namespace foldcar
