#include "attitude.h"

#include <algorithm>
#include <cmath>

#include "elementary_functions.h"

namespace foldcar {
namespace {

constexpr float kGravityMS2 = 9.81f;
constexpr float kPi = 3.14159265f;
// Time constant of the correction by gravity: long compared with the accelerations of driving and bumps.
constexpr float kGravityTimeS = 0.5f;
// A sample whose magnitude differs from gravity by more than this does not give the direction of the vertical.
constexpr float kShakenMS2 = 3.0f;

using Vector = std::array<float, 3>;

float length(const Vector& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

Vector scaled_to_1(const Vector& v) {
  const float size = length(v);
  return {v[0] / size, v[1] / size, v[2] / size};
}

}  // namespace

// Complementary filter: turns the vertical by the gyroscope's rates, then pulls it towards the accelerometer's
// direction with a time constant of kGravityTimeS, unless the car is shaken. Yaw is integrated from the rate about the
// vertical.
Attitude updated(const Attitude& before, const ImuSample& sample, float step_s) {
  const Vector& a = sample.acceleration_m_s2;
  const Vector& w = sample.rate_rad_s;
  const float size = length(a);
  const bool still = std::fabs(size - kGravityMS2) < kShakenMS2;
  Attitude after = before;
  after.known = true;
  if (!before.known) {
    if (still) after.up = scaled_to_1(a);
    return after;
  }
  // The vertical is fixed in the world, so in the car's turning axes d(up)/dt = up x rate.
  const Vector& u = before.up;
  Vector up = {u[0] + step_s * (u[1] * w[2] - u[2] * w[1]), u[1] + step_s * (u[2] * w[0] - u[0] * w[2]),
               u[2] + step_s * (u[0] * w[1] - u[1] * w[0])};
  if (still) {
    const float gain = std::min(step_s / kGravityTimeS, 1.0f);
    for (std::size_t i = 0; i < 3; ++i) up[i] += gain * (a[i] / size - up[i]);
  }
  if (length(up) > 0.1f) after.up = scaled_to_1(up);
  const float yaw_rad = before.yaw_rad + step_s * (w[0] * u[0] + w[1] * u[1] + w[2] * u[2]);
  after.yaw_rad = std::remainder(yaw_rad, 2.0f * kPi);
  return after;
}

float roll_rad(const Attitude& attitude) {
  return static_cast<float>(arc_tangent(attitude.up[1], attitude.up[2]));
}

float pitch_rad(const Attitude& attitude) {
  return static_cast<float>(arc_sine(std::clamp(attitude.up[0], -1.0f, 1.0f)));
}

float tilt_rad(const Attitude& attitude) {
  return static_cast<float>(arc_cosine(std::clamp(attitude.up[2], -1.0f, 1.0f)));
}

}  // namespace foldcar
