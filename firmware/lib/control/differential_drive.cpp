#include "differential_drive.h"

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

// Moves a value towards a target by at most `step`.
float approach(float value, float target, float step) {
  return value < target ? std::min(value + step, target) : std::max(value - step, target);
}

// Returns the pulse (µs) that lies excess_us beyond the servo's deadband, in which it stands: the pulse skips the
// deadband, and the slew limit applies to the excess only.
float pulse_us(const WheelCalibration& wheel, float excess_us) {
  if (excess_us == 0.0f) return wheel.neutral_us;
  const float from_neutral_us = excess_us + (excess_us > 0.0f ? wheel.deadband_us : -wheel.deadband_us);
  return std::clamp(wheel.neutral_us + wheel.direction * from_neutral_us, kShortestPulseUs, kLongestPulseUs);
}

}  // namespace

// Converts speed and yaw rate to the wheel speeds of both sides. If one is above the maximum, both are scaled down, so
// that the car keeps its radius of turn.
WheelSpeeds wheel_speeds(const Calibration& calibration, const SetPoint& set_point) {
  const float turn_m_s = set_point.yaw_rate_rad_s * calibration.half_track_m;
  const float left_rad_s = (set_point.speed_m_s - turn_m_s) / calibration.wheel_radius_m;
  const float right_rad_s = (set_point.speed_m_s + turn_m_s) / calibration.wheel_radius_m;
  const float fastest_rad_s = std::max(std::fabs(left_rad_s), std::fabs(right_rad_s));
  if (fastest_rad_s <= calibration.wheel_max_rad_s) return {left_rad_s, right_rad_s};
  const float scale = calibration.wheel_max_rad_s / fastest_rad_s;
  return {scale * left_rad_s, scale * right_rad_s};
}

// Returns the pulses of all outputs for one step: each wheel's excess approaches gain · wheel speed within the slew
// limit, from the wheel's start time on.
PulsesUs drive(const Calibration& calibration, DriveState& state, const SetPoint& set_point,
               std::uint32_t step_us) {
  state.elapsed_us += std::min(step_us, UINT32_MAX - state.elapsed_us);
  const WheelSpeeds speeds = wheel_speeds(calibration, set_point);
  PulsesUs pulses_us{};
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
    const WheelCalibration& wheel = calibration.wheels[channel];
    if (wheel.side == Side::kUnused) {
      pulses_us[channel] = kNoPulse;
      continue;
    }
    // A wheel that starts within this step ramps for the rest of it, so that the ramp does not depend on the tick.
    const std::uint32_t started_for_us =
        state.elapsed_us > wheel.starts_at_us ? std::min(step_us, state.elapsed_us - wheel.starts_at_us) : 0;
    const float speed_rad_s = wheel.side == Side::kLeft ? speeds.left_rad_s : speeds.right_rad_s;
    const float largest_change_us = calibration.slew_us_per_us * static_cast<float>(started_for_us);
    float& excess_us = state.excess_us[channel];
    excess_us = approach(excess_us, wheel.gain_us * speed_rad_s, largest_change_us);
    pulses_us[channel] = pulse_us(wheel, excess_us);
  }
  return pulses_us;
}

}  // namespace foldcar
