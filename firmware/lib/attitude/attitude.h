// How the car is tilted, from an IMU: turn rates in the short run, gravity in the long.
//
// Input: IMU samples and the time between them. Output: roll, pitch, yaw and tilt. Rate: each tick. Pure, like the
// controller. Roll is positive with the left side up, pitch with the nose up, yaw to the left, from 0 at the start.
#pragma once

#include <array>

#include "hal.h"

namespace foldcar {

struct Attitude {
  std::array<float, 3> up{0.0f, 0.0f, 1.0f};  // the vertical in the car's axes, length 1
  float yaw_rad = 0.0f;
  bool known = false;  // whether a sample has been seen
};

// The state after step_s more with that sample.
Attitude updated(const Attitude& before, const ImuSample& sample, float step_s);

float roll_rad(const Attitude& attitude);
float pitch_rad(const Attitude& attitude);
// Between the car's up axis and the vertical, 0 to pi.
float tilt_rad(const Attitude& attitude);

}  // namespace foldcar
