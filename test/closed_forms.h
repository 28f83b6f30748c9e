// A study car of any engine, and closed forms that every engine is held to, each within a tolerance of its own.
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

// Speed along the slope after it has been climbed, or not, for a while.
template <class Drive>
double speed_on_slope_m_s(const BodySpec& body, double friction, double slope_rad, double fraction, double time_s) {
  Drive drive(body, scene_of(slope_of(slope_rad), friction, {4, 0, 0}), fraction);
  return drive.run(time_s).speed_m_s / std::cos(slope_rad);
}

template <class Drive>
void stands_on_its_wheels() {
  Drive drive(study_car(0.115), scene_of({}, 0.6), 0);
  const CarState& state = drive.run(2);
  TEST_ASSERT_DOUBLE_WITHIN(0.0003, 0.06, state.z_m);
  TEST_ASSERT_DOUBLE_WITHIN(0.001, 0, state.x_m);
  TEST_ASSERT_DOUBLE_WITHIN(0.002, 0, state.pitch_rad);
}

template <class Drive>
void reaches_top_speed_where_the_torque_line_ends() {
  const BodySpec body = study_car(0.115);
  for (const double fraction : {1.0, 0.5, -1.0}) {
    Drive drive(body, scene_of({}, 0.6), fraction);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, no_slip_speed_m_s(body, 0, fraction), drive.run(2).speed_m_s);
  }
}

template <class Drive>
void is_slowed_by_a_load_along_the_torque_line(double within_m_s) {
  const BodySpec body = study_car(0.115);
  const double slope_rad = 15 * kPi / 180;
  for (const double fraction : {0.0, 0.5, 1.0}) {
    TEST_ASSERT_DOUBLE_WITHIN(within_m_s, no_slip_speed_m_s(body, slope_rad, fraction),
                              speed_on_slope_m_s<Drive>(body, 1.0, slope_rad, fraction, 2.5));
  }
}

template <class Drive>
void is_slowed_by_a_supply_that_sags(double within_m_s) {
  BodySpec body = study_car(0.115);
  body.supply_resistance_ohm = 0.8;
  for (const double slope_rad : {0.0, 15 * kPi / 180}) {
    for (const double fraction : {0.5, 1.0}) {
      TEST_ASSERT_DOUBLE_WITHIN(within_m_s, no_slip_speed_m_s(body, slope_rad, fraction),
                                speed_on_slope_m_s<Drive>(body, 1.0, slope_rad, fraction, 2.5));
    }
  }
}

// Half the servos carry the load; the other wheels, which have none, take no current and give no torque.
template <class Drive>
void is_driven_by_its_driven_axle(double within_m_s) {
  BodySpec body = with_free_wheels(study_car(0.115));
  body.supply_resistance_ohm = 0.8;
  for (const double slope_rad : {0.0, 8 * kPi / 180}) {
    TEST_ASSERT_DOUBLE_WITHIN(within_m_s, no_slip_speed_m_s(body, slope_rad, 1),
                              speed_on_slope_m_s<Drive>(body, 1.0, slope_rad, 1, 2.5));
  }
}

// Rolling back on wheels without servos, whatever the pulses: m g sin = (m + Σ I / r²) a, I = ½ m r² of each disc.
template <class Drive>
void coasts_down_a_slope_on_free_wheels() {
  const BodySpec body = with_free_wheels(study_car(0.115), true);
  const double slope_rad = 10 * kPi / 180, early_s = 0.25, late_s = 0.65;
  const double rolling_kg = mass_kg(body) + 4 * 0.5 * body.wheels[0].mass_kg;
  const double expected = -kGravity * std::sin(slope_rad) * mass_kg(body) / rolling_kg;
  for (const double fraction : {0.0, 1.0}) {
    const PulsesUs pulses_us = pulses_for(study_car(0.115), fraction);
    const SceneSpec scene = scene_of(slope_of(slope_rad), 1.0, {4, 0, 0});
    Drive drive(body, scene, pulses_us);
    const double early_m_s = drive.run(early_s).speed_m_s, late_m_s = drive.run(late_s - early_s).speed_m_s;
    const double acceleration = (late_m_s - early_m_s) / (late_s - early_s) / std::cos(slope_rad);
    TEST_ASSERT_DOUBLE_WITHIN(0.01 * std::abs(expected), expected, acceleration);
    TEST_ASSERT_EQUAL_DOUBLE(0, drive.car.state().motor_work_j);
    TEST_ASSERT_EQUAL_DOUBLE(0, drive.car.state().consumed_energy_j);
  }
}

// Wheels of two radii pitch it by asin((r1 - r2) / wheelbase); its middle is half way between the axles.
template <class Drive>
void stands_tilted_by_its_radii() {
  for (const double rear_m : {0.05, 0.068}) {
    BodySpec body = study_car(0.115);
    for (WheelSpec& wheel : body.wheels) wheel.radius_m = wheel.x_m > 0 ? 0.06 : rear_m;
    Drive drive(body, scene_of({}, 0.6), 0);
    const CarState& state = drive.run(1);
    TEST_ASSERT_DOUBLE_WITHIN(0.003, std::asin((0.06 - rear_m) / 0.14), state.pitch_rad);
    TEST_ASSERT_DOUBLE_WITHIN(0.0004, 0.5 * (0.06 + rear_m), state.z_m);
  }
}

template <class Drive>
void stalls_where_the_slope_asks_for_more_than_stall_torque() {
  BodySpec body = study_car(0.115);
  for (WheelSpec& wheel : body.wheels) wheel.servo.stall_torque_n_m = 0.02;
  const double limit_rad = std::asin(4 * 0.02 / (0.06 * mass_kg(body) * kGravity)), margin_rad = 2 * kPi / 180;
  TEST_ASSERT_TRUE(speed_on_slope_m_s<Drive>(body, 3.0, limit_rad - margin_rad, 1, 4) > 0.005);
  TEST_ASSERT_TRUE(speed_on_slope_m_s<Drive>(body, 3.0, limit_rad + margin_rad, 1, 4) < -0.005);
}

template <class Drive>
void climbs_to_the_friction_angle() {
  const BodySpec body = study_car(0.115);
  const double friction = 0.3, angle_rad = std::atan(friction), margin_rad = 2 * kPi / 180;
  TEST_ASSERT_TRUE(speed_on_slope_m_s<Drive>(body, friction, angle_rad - margin_rad, 1, 2) > 0.1);
  TEST_ASSERT_TRUE(speed_on_slope_m_s<Drive>(body, friction, angle_rad + margin_rad, 1, 2) < 0);
}

// Front wheels against a step, at rest: does the slow drive lift them onto it?
template <class Drive>
bool climbs_step(const BodySpec& body, double friction, double height_m, double fraction) {
  const double touching_m = 0.5 - 0.07 - std::sqrt(0.06 * 0.06 - (0.06 - height_m) * (0.06 - height_m));
  Drive drive(body, scene_of(blocks({{1.0, 0, 1.0, 2.0, height_m, 0}}), friction, {touching_m - 1e-4, 0, 0}), fraction);
  double highest_rad = 0;
  for (int i = 0; i < 40; ++i) highest_rad = std::max(highest_rad, drive.run(0.1).pitch_rad);
  return highest_rad > 0.8 * std::asin(height_m / 0.14);
}

// Limited by friction, then by torque; driven so slowly or weakly that momentum lifts it a few millimetres only.
template <class Drive>
void climbs_the_highest_step_that_statics_allow(double below_m, double above_m, bool by_torque = true) {
  struct Case {
    double friction, stall_torque_n_m, fraction;
  };
  for (const Case& limit : {Case{0.3, 0.134, 0.2}, Case{0.4, 0.134, 0.2}, Case{0.45, 0.134, 0.2},
                            Case{0.5, 0.134, 0.2}, Case{2, 0.010, 1}, Case{2, 0.015, 1}}) {
    if (limit.fraction == 1 && !by_torque) continue;
    BodySpec body = study_car(0.115);
    for (WheelSpec& wheel : body.wheels) wheel.servo.stall_torque_n_m = limit.stall_torque_n_m;
    const double highest_m = highest_climbable_step_m(body, limit.friction);
    TEST_ASSERT_TRUE(highest_m > 0.01 && highest_m < 0.055);
    TEST_ASSERT_TRUE(climbs_step<Drive>(body, limit.friction, highest_m - below_m, limit.fraction));
    TEST_ASSERT_FALSE(climbs_step<Drive>(body, limit.friction, highest_m + above_m, limit.fraction));
  }
}

template <class Drive>
void turns_motor_work_into_mechanical_energy_without_slip(double within, const typename Drive::Options& options = {}) {
  const BodySpec body = study_car(0.115);
  Drive drive(body, scene_of({}, 2), 0, options);
  drive.run(0.5);
  const double unexplained_j = drive.unexplained_j(), work_j = drive.car.state().motor_work_j;
  drive.pulses_us = pulses_for(body, 0.6);
  drive.run(0.15);
  const CarState& state = drive.car.state();
  const double done_j = state.motor_work_j - work_j;
  TEST_ASSERT_TRUE(done_j > 0.005);
  TEST_ASSERT_DOUBLE_WITHIN(within * done_j, unexplained_j, drive.unexplained_j());
  TEST_ASSERT_TRUE(state.consumed_energy_j > state.motor_work_j);
}

// Hitting an edge, a wheel enters it by a step's travel and is pushed out at no cost: short steps keep that below the
// tolerance.
template <class Drive>
void gains_no_energy_by_friction_and_impacts(const BodySpec& body, const typename Drive::Options& options = {}) {
  constexpr double kTolerance_j = 0.004;
  Drive drive(body, scene_of(blocks({{0.45, 0, 0.06, 2, 0.02, 0}, {0.85, 0, 0.06, 2, 0.02, 0}}), 0.6), 1, options);
  drive.run(0.25);
  const double start_j = drive.unexplained_j();
  double least_j = start_j;
  while (drive.car.state().x_m < 1.3) {
    drive.run(drive.step_s);
    TEST_ASSERT_TRUE(drive.car.finite());
    TEST_ASSERT_TRUE(drive.unexplained_j() < least_j + kTolerance_j);
    least_j = std::min(least_j, drive.unexplained_j());
  }
  TEST_ASSERT_TRUE(least_j < start_j - kTolerance_j);
}

// Locked wheels on a slippery patch from x = 0.5 m on.
template <class Drive>
void brakes_with_the_friction_of_the_patch(BodySpec body, double time_s) {
  TerrainSpec terrain;
  terrain.patches.push_back({2, 0, 0, 3, 2, 0.15});
  for (WheelSpec& wheel : body.wheels) wheel.servo.stall_torque_n_m = 0.5;
  Drive drive(body, scene_of(terrain, 0.8), 1);
  while (drive.car.state().x_m < 0.75) drive.run(drive.step_s);
  drive.pulses_us = pulses_for(body, 0);
  const double early_m_s = drive.run(0.05).speed_m_s, late_m_s = drive.run(time_s).speed_m_s;
  TEST_ASSERT_TRUE(late_m_s > 0.1);
  TEST_ASSERT_DOUBLE_WITHIN(0.04 * 0.15 * kGravity, 0.15 * kGravity, (early_m_s - late_m_s) / time_s);
}

// The largest pitch while its wheels are brought to full speed, backwards out of full speed ahead. The reaction of what
// spins up the geared rotors stays in the gearbox: a frame that took it would rear up, or turn over in a reversal.
template <class Drive>
double largest_pitch_rad(double fraction) {
  const BodySpec body = study_car(0.115);
  Drive drive(body, scene_of({}, 0.6), fraction > 0 ? 0 : 1);
  drive.run(1.3);
  drive.pulses_us = pulses_for(body, fraction);
  double largest_rad = 0;
  for (int i = 0; i < 240; ++i) largest_rad = std::max(largest_rad, std::abs(drive.run(drive.step_s).pitch_rad));
  return largest_rad;
}

// How near an engine is to the closed forms.
template <class Options>
struct Nearness {
  double load_m_s;                    // to the speed under a load
  double step_below_m, step_above_m;  // to the highest step
  bool by_torque;                     // that a weak servo climbs, too
  double work;                        // share of the motors' work that may be missing
  Options work_options;
  bool with_rotors;  // energy is judged with their inertia
  Options fine;      // steps short enough to judge energy in impacts
};

}  // namespace foldcar

// The tests of all closed forms for an engine.
#define TEST_CLOSED_FORMS(Drive, near)                                                                             \
  TEST(test_it_stands_on_its_wheels) { stands_on_its_wheels<Drive>(); }                                            \
  TEST(test_top_speed_is_where_the_torque_line_ends) { reaches_top_speed_where_the_torque_line_ends<Drive>(); }    \
  TEST(test_a_load_slows_it_along_the_torque_line) {                                                               \
    is_slowed_by_a_load_along_the_torque_line<Drive>((near).load_m_s);                                             \
  }                                                                                                                \
  TEST(test_a_supply_that_sags_slows_it_by_its_current) { is_slowed_by_a_supply_that_sags<Drive>((near).load_m_s); } \
  TEST(test_half_the_servos_carry_the_load_of_a_car_with_free_wheels) {                                            \
    is_driven_by_its_driven_axle<Drive>((near).load_m_s);                                                          \
  }                                                                                                                \
  TEST(test_it_coasts_down_a_slope_on_free_wheels) { coasts_down_a_slope_on_free_wheels<Drive>(); }                \
  TEST(test_wheels_of_two_radii_tilt_it) { stands_tilted_by_its_radii<Drive>(); }                                  \
  TEST(test_it_stalls_where_the_slope_asks_for_more_than_stall_torque) {                                           \
    stalls_where_the_slope_asks_for_more_than_stall_torque<Drive>();                                               \
  }                                                                                                                \
  TEST(test_all_wheel_drive_climbs_to_the_friction_angle) { climbs_to_the_friction_angle<Drive>(); }               \
  TEST(test_the_highest_step_climbed_is_the_one_statics_allow) {                                                   \
    climbs_the_highest_step_that_statics_allow<Drive>((near).step_below_m, (near).step_above_m, (near).by_torque); \
  }                                                                                                                \
  TEST(test_without_slip_motor_work_becomes_mechanical_energy) {                                                   \
    turns_motor_work_into_mechanical_energy_without_slip<Drive>((near).work, (near).work_options);                 \
  }                                                                                                                \
  TEST(test_friction_and_impacts_never_give_energy) {                                                              \
    const BodySpec body = study_car(0.115);                                                                        \
    gains_no_energy_by_friction_and_impacts<Drive>((near).with_rotors ? body : without_rotors(body), (near).fine); \
  }                                                                                                                \
  TEST(test_locked_wheels_brake_with_the_friction_of_the_patch) {                                                  \
    const BodySpec body = study_car(0.115);                                                                        \
    brakes_with_the_friction_of_the_patch<Drive>((near).with_rotors ? body : without_rotors(body), 0.2);           \
  }                                                                                                                \
  static_assert(true)
