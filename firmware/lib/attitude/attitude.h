// The car's attitude from an IMU, by a complementary filter: it integrates the turn rates and corrects their drift with the
// direction of gravity.
//
// Input: IMU samples and the time between them. Output: roll, pitch, yaw and tilt (rad). Rate: each tick. Pure functions.
// Roll is positive with the left side up, pitch with the nose up, yaw to the left, from 0 at the start.
#pragma once

#include <array>

#include "hal.h"

namespace foldcar {

struct Attitude {
  std::array<float, 3> up{0.0f, 0.0f, 1.0f};  // unit vector of the vertical in the car's axes
  float yaw_rad = 0.0f;
  bool known = false;  // whether there has been a sample
};

// The attitude one time step (s) after before, with the sample measured at its end.
Attitude updated(const Attitude& before, const ImuSample& sample, float step_s);

// Angles in rad: roll from -pi to pi, pitch from -pi/2 to pi/2.
float roll_rad(const Attitude& attitude);
float pitch_rad(const Attitude& attitude);
// Angle (rad) between the car's z axis and the vertical, 0 to pi.
float tilt_rad(const Attitude& attitude);

}  // namespace foldcar
