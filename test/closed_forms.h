// Closed forms of a rigid study car on slopes and steps, which every engine is held to.
#pragma once

#include <algorithm>
#include <cmath>

#include "body_spec.h"
#include "car_constants.h"
#include "scene_spec.h"
#include "study_car.h"

namespace foldcar {

constexpr double kPi = 3.14159265358979323846;
constexpr double kGravity = 9.81;

inline double mass_kg(const BodySpec& body) { return CarConstants(body).mass_kg; }

// Flat up to x = 0.3 m, then rising by slope_rad for 20 m.
inline TerrainSpec slope_of(double slope_rad) {
  constexpr double kFoot_m = 0.3, kLength_m = 20;
  return blocks({{kFoot_m + 0.5 * kLength_m, 0, kLength_m, 4, kLength_m * std::tan(slope_rad), 0, BlockSpec::Kind::kRamp}});
}

// Speed along a slope where the servos hold it (m/s).
inline double no_slip_speed_m_s(const BodySpec& body, double slope_rad, double fraction) {
  const ServoSpec& servo = body.wheels[0].servo;
  const double radius_m = body.wheels[0].radius_m;
  const double load_n_m = mass_kg(body) * kGravity * std::sin(slope_rad) * radius_m;
  return radius_m * servo.no_load_speed_rad_s * (fraction - load_n_m / (4 * servo.stall_torque_n_m));
}

// Whether forces at the friction and torque limits can lift the front wheels over the edge of a step: three
// equations of equilibrium for the loads and drives of both axles; the rear drive is what is left to choose.
inline bool step_is_climbable(const BodySpec& body, double friction, double height_m) {
  const double radius_m = 0.06, axle_m = 0.07;
  const double weight_n = mass_kg(body) * kGravity, drive_limit_n = 2 * body.wheels[0].servo.stall_torque_n_m / radius_m;
  const double cosine = (radius_m - height_m) / radius_m, sine = std::sqrt(1 - cosine * cosine);
  const double edge_x_m = axle_m + radius_m * sine, edge_z_m = height_m;
  // The edge's normal is (-sine, cosine), its forward tangent (cosine, sine). The front's force has no moment
  // about the edge, so each rear drive gives the rear load, and the front follows.
  for (int i = -1000; i <= 1000; ++i) {
    const double rear_drive_n = drive_limit_n * i / 1000;
    const double rear_load_n = (weight_n * edge_x_m + rear_drive_n * edge_z_m) / (edge_x_m + axle_m);
    const double front_x_n = -rear_drive_n, front_z_n = weight_n - rear_load_n;
    const double front_load_n = -sine * front_x_n + cosine * front_z_n;
    const double front_drive_n = cosine * front_x_n + sine * front_z_n;
    const bool possible = rear_load_n >= 0 && front_load_n >= 0 &&
                          std::abs(rear_drive_n) <= friction * rear_load_n &&
                          std::abs(front_drive_n) <= std::min(friction * front_load_n, drive_limit_n);
    if (possible) return true;
  }
  return false;
}

// The highest of them.
inline double highest_climbable_step_m(const BodySpec& body, double friction) {
  double low_m = 0.001, high_m = 0.0599;
  while (high_m - low_m > 1e-5) {
    const double middle_m = 0.5 * (low_m + high_m);
    (step_is_climbable(body, friction, middle_m) ? low_m : high_m) = middle_m;
  }
  return low_m;
}

}  // namespace foldcar
