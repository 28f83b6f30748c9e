// The controller's constants, computed from the parameters once at the start of a trial.
//
// Input: Parameters. Output: the car's geometry, and for each channel the relation of wheel speed and pulse width.
#pragma once

#include <array>
#include <cstdint>

#include "hal.h"
#include "parameters.h"

namespace foldcar {

struct WheelCalibration {
  Side side = Side::kUnused;
  float neutral_us = 0.0f;
  float direction = 1.0f;          // 1 or -1: sign of a forward pulse's distance from neutral
  float deadband_us = 0.0f;        // not negative
  float gain_us = 0.0f;            // pulse width (µs) beyond the deadband for each rad/s
  std::uint32_t starts_at_us = 0;  // time (µs) since the start of the trial until which the wheel stands
};

struct Calibration {
  std::array<WheelCalibration, kChannelCount> wheels{};
  float wheel_radius_m = 0.0f;
  float half_track_m = 0.0f;
  float wheel_max_rad_s = 0.0f;
  float slew_us_per_us = 0.0f;  // largest change of a pulse width (µs) in each µs
};

// The wheels of a side start one after the other, STAGGER_MS apart, in the order of their channels, which count from the
// front. The n-th wheel of the left starts with the n-th of the right, so that the start does not turn the car.
Calibration calibrate(const Parameters& parameters);

}  // namespace foldcar
