// The controller of a differential drive: from the car's speed and yaw rate to a pulse width for each wheel's servo.
//
// A pure function of (calibration, state, set-point, time step). Rate: each tick. Yaw is positive to the left, so a
// positive yaw rate makes the right wheels faster.
#pragma once

#include <array>
#include <cstdint>

#include "calibration.h"
#include "hal.h"

namespace foldcar {

// The motion that the car is to have.
struct SetPoint {
  float speed_m_s = 0.0f;
  float yaw_rate_rad_s = 0.0f;
};

// Speeds of the wheels of each side; positive drives the car forward.
struct WheelSpeeds {
  float left_rad_s = 0.0f;
  float right_rad_s = 0.0f;
};

// The controller's state; a new object is that at the start of a trial.
struct DriveState {
  std::uint32_t elapsed_us = 0;  // since the start; stands still after 71 minutes, when 32 bits are full
  std::array<float, kChannelCount> excess_us{};  // pulse width beyond the deadband (µs), positive drives forward
};

// Range of pulse widths that hobby servos accept; the controller stays within it whatever the parameters are.
constexpr float kShortestPulseUs = 1000.0f;
constexpr float kLongestPulseUs = 2000.0f;

// The wheel speeds of a set-point. If a side exceeds the largest wheel speed, both are scaled by the same factor: the car
// keeps its curvature and is slower.
WheelSpeeds wheel_speeds(const Calibration& calibration, const SetPoint& set_point);

// The pulses after a time step of step_us (µs), by which state advances. A wheel at rest gets its neutral pulse, an unused
// channel kNoPulse.
PulsesUs drive(const Calibration& calibration, DriveState& state, const SetPoint& set_point,
               std::uint32_t step_us);

}  // namespace foldcar
