#include "calibration.h"

namespace foldcar {

// Converts the parameters to the controller's constants. The wheels of a side start one after another, kStaggerMs
// apart, so that their starting currents do not add up.
Calibration calibrate(const Parameters& parameters) {
  Calibration calibration;
  calibration.wheel_radius_m = parameters.get(Parameter::kWheelRadiusM);
  calibration.half_track_m = 0.5f * parameters.get(Parameter::kTrackM);
  calibration.wheel_max_rad_s = parameters.get(Parameter::kWheelMaxRadS);
  calibration.slew_us_per_us = 1e-6f * parameters.get(Parameter::kSlewUsPerS);

  const auto stagger_us = static_cast<std::uint32_t>(1000.0f * parameters.get(Parameter::kStaggerMs));
  std::uint32_t left_count = 0;
  std::uint32_t right_count = 0;
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
    WheelCalibration& wheel = calibration.wheels[channel];
    wheel.side = static_cast<Side>(parameters.get(channel, ChannelParameter::kSide));
    if (wheel.side == Side::kUnused) continue;
    wheel.neutral_us = parameters.get(channel, ChannelParameter::kNeutralUs);
    const bool is_reversed = parameters.get(channel, ChannelParameter::kReversed) != 0.0f;
    wheel.direction = parameters.get(channel, ChannelParameter::kDirection) * (is_reversed ? -1.0f : 1.0f);
    wheel.deadband_us = parameters.get(channel, ChannelParameter::kDeadbandUs);
    wheel.gain_us = parameters.get(channel, ChannelParameter::kGainUs);
    std::uint32_t& count = wheel.side == Side::kLeft ? left_count : right_count;
    wheel.starts_at_us = count++ * stagger_us;
  }
  return calibration;
}

}  // namespace foldcar
