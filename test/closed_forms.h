// A study car of any engine on its scene, and closed forms of statics and dynamics that it must obey.
#pragma once

#include "suite.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "body_spec.h"
#include "car_constants.h"
#include "scene_spec.h"
#include "scene_terrain.h"
#include "scoped_timer.h"
#include "sim_car.h"
#include "study_car.h"

namespace foldcar {

constexpr double kPi = 3.14159265358979323846;
constexpr double kGravity = 9.81;
const PulsesUs kNoPulses{};

template <class Options>
auto step_of(const Options& options) -> decltype(options.step_s) {
  return options.step_s;
}
template <class Options>
auto step_of(const Options& options) -> decltype(1 / options.rate_hz) {
  return 1 / options.rate_hz;
}

// A car of an engine on its scene, driven by pulses.
template <class Car, class EngineOptions>
struct DriveOf {
  using Options = EngineOptions;
  const BodySpec body;
  const SceneSpec scene;
  const SceneTerrain terrain;
  const double step_s;
  Car car;
  PulsesUs pulses_us;
  DriveOf(const BodySpec& body_spec, const SceneSpec& scene_spec, const PulsesUs& pulses, const Options& options = {})
      : body(body_spec),
        scene(scene_spec),
        terrain(scene.terrain),
        step_s(step_of(options)),
        car(create_car(body, scene, terrain, options)),
        pulses_us(pulses) {}
  DriveOf(const BodySpec& body_spec, const SceneSpec& scene_spec, double fraction, const Options& options = {})
      : DriveOf(body_spec, scene_spec, pulses_for(body_spec, fraction), options) {}
  const CarState& run(double time_s) {
    const int steps = static_cast<int>(std::lround(time_s / step_s));
    for (int i = 0; i < steps; ++i) car.step(pulses_us);
    return car.state();
  }
  // What neither motors nor the start gave.
  double unexplained_j() { return car.mechanical_energy_j() - car.state().motor_work_j; }

 private:
  static Car create_car(const BodySpec& body, const SceneSpec& scene, const SceneTerrain& terrain, const Options& options) {
    if constexpr (std::is_constructible_v<Car, const BodySpec&, double, const Terrain&, const PoseSpec&, const Options&,
                                          Stopwatch*>) {
      return Car(body, scene.friction, terrain, scene.start, options, nullptr);
    } else {
      return Car(body, scene, terrain, options, nullptr);
    }
  }
};

// Put down from no height, for what impacts would disturb.
template <class Options>
Options create_gently(double rate_hz = 240) {
  Options options;
  options.drop_m = 0;
  options.rate_hz = rate_hz;
  return options;
}

inline double mass_kg(const BodySpec& body) { return CarConstants(body).mass_kg; }

// Flat up to x = 0.3 m, then rising by slope_rad for 20 m.
inline TerrainSpec slope_of(double slope_rad) {
  constexpr double kFoot_m = 0.3, kLength_m = 20;
  return blocks({{kFoot_m + 0.5 * kLength_m, 0, kLength_m, 4, kLength_m * std::tan(slope_rad), 0, BlockSpec::Kind::kRamp}});
}

// Without servos at the rear axle, or at both.
inline BodySpec with_free_wheels(BodySpec body, bool front_too = false) {
  for (WheelSpec& wheel : body.wheels) {
    if (front_too || wheel.x_m < 0) wheel.servo = {};
  }
  return body;
}

// Speed along a slope where the servos hold it (m/s): the torque line at the voltage that the current leaves.
inline double no_slip_speed_m_s(const BodySpec& body, double slope_rad, double fraction) {
  const ServoSpec& servo = body.wheels[0].servo;
  const double radius_m = body.wheels[0].radius_m;
  double servos = 0;
  for (const WheelSpec& wheel : body.wheels) servos += wheel.driven();
  const double load_n_m = mass_kg(body) * kGravity * std::sin(slope_rad) * radius_m;
  const double stalled = load_n_m / (servos * servo.stall_torque_n_m);
  const double current_a =
      servos * (servo.no_load_current_a * fraction + (servo.stall_current_a - servo.no_load_current_a) * stalled);
  const double voltage_v = body.supply_v - body.supply_resistance_ohm * current_a;
  return radius_m * servo.no_load_speed_rad_s * (fraction * voltage_v / servo.rated_v - stalled);
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

// One half of the hinged study car on its free-rolling wheels, the hinge between the axles. By symmetry the hinge
// carries no shear, so the half turns about its axle (0.07 m) under its weight (at 0.05 m, 4 mm up) and the flexure.
struct HingedHalf {
  double mass_kg, inertia_kg_m2, stiffness_n_m_rad;
  static constexpr double kLever_m = 0.02, kHeight_m = 0.004;
  explicit HingedHalf(const BodySpec& body)
      : mass_kg(body.segments[0].mass_kg),
        inertia_kg_m2(body.segments[0].pitch_inertia_kg_m2 +
                      mass_kg * (kLever_m * kLever_m + kHeight_m * kHeight_m)),
        stiffness_n_m_rad(body.hinges[0].stiffness_n_m_rad) {}
  double weight_n_m(double tilt_rad) const {
    return mass_kg * kGravity * (kLever_m * std::cos(tilt_rad) + kHeight_m * std::sin(tilt_rad));
  }
  // The fold at rest: twice the tilt of a half.
  double sag_rad() const {
    double tilt_rad = 0;
    for (int i = 0; i < 100; ++i) tilt_rad = weight_n_m(tilt_rad) / (2 * stiffness_n_m_rad);
    return 2 * tilt_rad;
  }
  double swing_rad_s() const {
    const double tilt_rad = 0.5 * sag_rad();
    const double slope = mass_kg * kGravity * (kHeight_m * std::cos(tilt_rad) - kLever_m * std::sin(tilt_rad));
    return std::sqrt((2 * stiffness_n_m_rad - slope) / inertia_kg_m2);
  }
};

// The whole car, of equal wheels, as a rigid body in the plane across it: from its parts, by Steiner's theorem.
struct AcrossPlane {
  double mass_kg = 0, height_m = 0, inertia_kg_m2 = 0;  // about the centre of mass
  double edge_m;                                         // of the tyres, beside the middle
  explicit AcrossPlane(const BodySpec& body) : edge_m(0.5 * (body.track_m + body.wheels[0].width_m)) {
    const double radius_m = body.wheels[0].radius_m;
    double moment = 0, about_axles = 0;
    for (const SegmentSpec& part : body.segments) {
      mass_kg += part.mass_kg;
      moment += part.mass_kg * part.com_z_m;
      about_axles += part.roll_inertia_kg_m2 + part.mass_kg * part.com_z_m * part.com_z_m;
    }
    for (const WheelSpec& wheel : body.wheels) {
      mass_kg += wheel.mass_kg;
      about_axles += wheel.mass_kg * (std::pow(0.5 * body.track_m, 2) + 0.25 * radius_m * radius_m +
                                      wheel.width_m * wheel.width_m / 12);
    }
    const double above_axles_m = moment / mass_kg;
    height_m = radius_m + above_axles_m;
    inertia_kg_m2 = about_axles - mass_kg * above_axles_m * above_axles_m;
  }
  // Leaning by from_rad on the low side's tyre edge, at rest, it falls back:
  // (I + m (h² + a²)) φ'' = -m g (a cos φ - h sin φ), a beside the middle.
  double falling_back_s(double from_rad) const {
    constexpr double kStep_s = 1e-5;
    double lean_rad = from_rad, rate_rad_s = 0, time_s = 0;
    for (; lean_rad > 0; time_s += kStep_s) {
      const double moment_n_m = mass_kg * kGravity * (edge_m * std::cos(lean_rad) - height_m * std::sin(lean_rad));
      rate_rad_s -= moment_n_m / (inertia_kg_m2 + mass_kg * (edge_m * edge_m + height_m * height_m)) * kStep_s;
      lean_rad += rate_rad_s * kStep_s;
    }
    return time_s;
  }
};

}  // namespace foldcar
