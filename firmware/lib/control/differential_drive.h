// The controller: speed and turn rate of the car to a pulse for every wheel's servo.
//
// A pure function of (calibration, state, set-point, time step), without clock or hardware. Rate: each tick.
// Yaw is positive to the left, so a positive yaw rate drives the right wheels faster.
#pragma once

#include <array>
#include <cstdint>

#include "calibration.h"
#include "hal.h"

namespace foldcar {

struct SetPoint {
  float speed_m_s = 0.0f;
  float yaw_rate_rad_s = 0.0f;
};

// Positive drives the car forward.
struct WheelSpeeds {
  float left_rad_s = 0.0f;
  float right_rad_s = 0.0f;
};

// What the controller remembers between steps; a fresh one is the start of a trial.
struct DriveState {
  std::uint32_t elapsed_us = 0;  // lasts 71 minutes, TRIAL_MAX_S ends at 60
  std::array<float, kChannelCount> beyond_us{};  // pulse beyond the deadband, positive drives forward
};

// Pulses the servos understand, whatever the parameters say.
constexpr float kShortestPulseUs = 1000.0f;
constexpr float kLongestPulseUs = 2000.0f;

// Both sides are scaled back together if one is beyond the fastest wheel speed: the car keeps its curve and
// goes slower.
WheelSpeeds wheel_speeds(const Calibration& calibration, const SetPoint& set_point);

// Advances state by step_us. A standing wheel gets its neutral pulse, an unused channel kNoPulse.
PulsesUs drive(const Calibration& calibration, DriveState& state, const SetPoint& set_point,
               std::uint32_t step_us);

}  // namespace foldcar
