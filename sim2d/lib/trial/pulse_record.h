// What the firmware puts out in a trial, without a world around it: it reads no sensor but its own battery, so
// its pulses are a function of the settings alone.
//
// Input: set-point, time limit and parameters. Output: the pulse widths whenever they change. The clock runs in
// the simulator's steps, so the changes stand at the very times at which a run has them.
#pragma once

#include <vector>

#include "hal.h"
#include "trial.h"

namespace foldcar {

struct PulseChange {
  double t_s = 0;  // since the start of the trial; the first is before it, when the car is put down
  PulsesUs pulses_us{};
};

// Up to the tick at which the firmware ends the trial, included. TrialError if it refuses to start it.
std::vector<PulseChange> record_pulses(const TrialSpec& trial);

}  // namespace foldcar
