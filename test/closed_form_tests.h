// The tests of an engine against the closed forms, each within a tolerance of the engine's own.
#pragma once

#include "closed_forms.h"

namespace foldcar {

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
