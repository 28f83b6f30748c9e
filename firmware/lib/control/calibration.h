// What the controller needs of the parameters, worked out once at the start of a trial.
//
// Input: Parameters. Output: for each channel how wheel speed becomes pulse width, and the car's geometry.
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
  float gain_us = 0.0f;            // pulse beyond the deadband for each rad/s
  std::uint32_t starts_at_us = 0;  // since the start of the trial; before it the wheel stands
};

struct Calibration {
  std::array<WheelCalibration, kChannelCount> wheels{};
  float wheel_radius_m = 0.0f;
  float half_track_m = 0.0f;
  float wheel_max_rad_s = 0.0f;
  float slew_us_per_us = 0.0f;
};

// The wheels of a side start one after the other in the order of their channels, so channels are wired from
// the front; the n-th of the left starts with the n-th of the right, lest the car turn.
Calibration calibrate(const Parameters& parameters);

}  // namespace foldcar
