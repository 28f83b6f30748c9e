#include "motion_sensor.h"

#include <cmath>

#include "body_spec.h"
#include "elementary_functions.h"

namespace foldcar {
namespace {

// Time constant of the IMU's low-pass filter, whose corner frequency is 1 / (2 pi 0.006 s) = 27 Hz.
constexpr double kFilterTime_s = 0.006;

using Vector = std::array<double, 3>;

// Transforms a vector from the world's axes into the car's: rotates it by minus heading, pitch (nose up) and roll
// (left side up), in this order.
Vector into_car(const Vector& v, double heading_rad, double pitch_rad, double roll_rad) {
  const auto [sh, ch] = sine_and_cosine(heading_rad);
  const auto [sp, cp] = sine_and_cosine(pitch_rad);
  const auto [sr, cr] = sine_and_cosine(roll_rad);
  const double ahead = ch * v[0] + sh * v[1], left = -sh * v[0] + ch * v[1];
  const double forward = cp * ahead + sp * v[2], up = -sp * ahead + cp * v[2];
  return {forward, cr * left + sr * up, -sr * left + cr * up};
}

}  // namespace

// Returns what an IMU at the car's origin measures, in the car's axes: specific force (acceleration plus g upwards)
// and angular rate, from the differences of the last three poses, through a first-order low-pass filter.
ImuSample MotionSensor::observe(const CarState& car, double step_s) {
  const Pose now{{car.x_m, car.y_m, car.z_m}, {car.heading_rad, car.pitch_rad, car.roll_rad}};
  Vector acceleration{0, 0, kGravity_m_s2};
  Vector angle_rate{};
  if (poses_ > 0) {
    for (std::size_t i = 0; i < 3; ++i) {
      const double velocity_m_s = (now.place_m[i] - last_.place_m[i]) / step_s;
      if (poses_ > 1) acceleration[i] += (velocity_m_s - velocity_m_s_[i]) / step_s;
      velocity_m_s_[i] = velocity_m_s;
      angle_rate[i] = std::remainder(now.angles_rad[i] - last_.angles_rad[i], 2 * M_PI) / step_s;
    }
  }
  last_ = now;
  if (poses_ < 2) ++poses_;

  const Vector force = into_car(acceleration, car.heading_rad, car.pitch_rad, car.roll_rad);
  const auto [heading_rate, pitch_rate, roll_rate] = angle_rate;
  const auto [sp, cp] = sine_and_cosine(car.pitch_rad);
  const auto [sr, cr] = sine_and_cosine(car.roll_rad);
  const Vector rate = {roll_rate + heading_rate * sp, -pitch_rate * cr + heading_rate * cp * sr,
                       pitch_rate * sr + heading_rate * cp * cr};
  const double gain = poses_ < 2 ? 1 : step_s / (kFilterTime_s + step_s);
  for (std::size_t i = 0; i < 3; ++i) {
    float& a = sample_.acceleration_m_s2[i];
    float& w = sample_.rate_rad_s[i];
    a += static_cast<float>(gain * (force[i] - static_cast<double>(a)));
    w += static_cast<float>(gain * (rate[i] - static_cast<double>(w)));
  }
  return sample_;
}

}  // namespace foldcar
