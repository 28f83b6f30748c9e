// The car's physics against closed forms: fall, friction, torque-speed line, steps, tip-over, yaw, energy.
#include "../suite.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "../closed_forms.h"
#include "../study_car.h"
#include "multibody_car.h"
#include "scene_terrain.h"

using namespace foldcar;

namespace {

const SceneTerrain kFlat(TerrainSpec{});

struct Drive {
  BodySpec body;
  MultibodyCar car;
  PulsesUs pulses_us;
  Drive(const BodySpec& body_spec, double friction, const Terrain& terrain, double fraction, StepOptions options = {},
        PoseSpec start = {})
      : body(body_spec),
        car(body, friction, terrain, start, options, nullptr),
        pulses_us(pulses_for(body, fraction)) {}
  const CarState& run(double time_s) {
    const int steps = static_cast<int>(std::lround(time_s / car.step_s()));
    for (int i = 0; i < steps; ++i) car.step(pulses_us);
    return car.state();
  }
};

// Speed along the slope after it has been climbed (or not) for a while.
double speed_on_slope_m_s(const BodySpec& body, double friction, double slope_rad, double fraction, double time_s) {
  const SceneTerrain slope(slope_of(slope_rad));
  Drive drive(body, friction, slope, fraction, {}, {4.0, 0, 0});
  drive.run(time_s);
  return drive.car.state().speed_m_s / std::cos(slope_rad);
}

}  // namespace

TEST(test_it_falls_as_bodies_do) {
  StepOptions options;
  options.drop_m = 1;
  for (const double time_s : {0.1, 0.2, 0.4}) {
    Drive drive(study_car(0.115), 0.6, kFlat, 0, options);
    const double start_m = drive.car.state().z_m;
    const CarState& state = drive.run(time_s);
    // The integrator is ahead by half a step's worth of speed.
    const double fallen_m = 0.5 * kGravity * time_s * (time_s + drive.car.step_s());
    TEST_ASSERT_DOUBLE_WITHIN(0.001 * fallen_m, fallen_m, start_m - state.z_m);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0, state.pitch_rad);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0, state.roll_rad);
  }
}

TEST(test_it_stands_on_its_wheels) {
  const BodySpec body = study_car(0.115);
  Drive drive(body, 0.6, kFlat, 0);
  const CarState& state = drive.run(2);
  TEST_ASSERT_DOUBLE_WITHIN(0.0003, 0.06, state.z_m);
  TEST_ASSERT_DOUBLE_WITHIN(0.001, 0, state.x_m);
  TEST_ASSERT_DOUBLE_WITHIN(0.002, 0, state.pitch_rad);
}

TEST(test_it_neither_sinks_nor_slows_far_from_where_it_started) {
  Drive drive(study_car(0.095), 0.6, kFlat, 1);
  const CarState early = drive.run(5);
  const CarState& late = drive.run(75);
  TEST_ASSERT_TRUE(late.x_m > 40);
  TEST_ASSERT_DOUBLE_WITHIN(1e-4, early.z_m, late.z_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-3 * early.speed_m_s, early.speed_m_s, late.speed_m_s);
}

TEST(test_top_speed_is_where_the_torque_line_ends) {
  for (const double fraction : {1.0, 0.5, -1.0}) {
    const BodySpec body = study_car(0.115);
    Drive drive(body, 0.6, kFlat, fraction);
    drive.run(2);
    TEST_ASSERT_DOUBLE_WITHIN(0.015 * 0.69, no_slip_speed_m_s(body, 0, fraction), drive.car.state().speed_m_s);
  }
}

TEST(test_a_load_slows_it_along_the_torque_line) {
  const BodySpec body = study_car(0.115);
  for (const double fraction : {0.0, 0.5, 1.0}) {
    const double slope_rad = 15 * kPi / 180;
    const double expected_m_s = no_slip_speed_m_s(body, slope_rad, fraction);
    TEST_ASSERT_DOUBLE_WITHIN(0.012, expected_m_s, speed_on_slope_m_s(body, 1.0, slope_rad, fraction, 2.5));
  }
}

TEST(test_it_stalls_where_the_slope_asks_for_more_than_stall_torque) {
  BodySpec body = study_car(0.115);
  for (WheelSpec& wheel : body.wheels) wheel.servo.stall_torque_n_m = 0.02;
  const double limit_rad = std::asin(4 * 0.02 / (0.06 * mass_kg(body) * kGravity));
  const double margin_rad = 2 * kPi / 180;
  TEST_ASSERT_TRUE(speed_on_slope_m_s(body, 3.0, limit_rad - margin_rad, 1, 4) > 0.005);
  TEST_ASSERT_TRUE(speed_on_slope_m_s(body, 3.0, limit_rad + margin_rad, 1, 4) < -0.005);
}

TEST(test_friction_holds_braked_wheels_up_to_its_angle_and_no_further) {
  BodySpec body = study_car(0.115);
  for (WheelSpec& wheel : body.wheels) wheel.servo.stall_torque_n_m = 0.5;  // neutral holds almost as a lock does
  const double friction = 0.3, angle_rad = std::atan(friction), margin_rad = 3 * kPi / 180;
  const double below_rad = angle_rad - margin_rad;
  TEST_ASSERT_DOUBLE_WITHIN(0.006, no_slip_speed_m_s(body, below_rad, 0),
                            speed_on_slope_m_s(body, friction, below_rad, 0, 1.5));
  // Beyond, it slides with what friction leaves of gravity.
  const double beyond_rad = angle_rad + 3 * margin_rad, early_s = 0.25, late_s = 0.65;
  const double acceleration = (speed_on_slope_m_s(body, friction, beyond_rad, 0, late_s) -
                               speed_on_slope_m_s(body, friction, beyond_rad, 0, early_s)) /
                              (late_s - early_s);
  const double expected = -kGravity * (std::sin(beyond_rad) - friction * std::cos(beyond_rad));
  TEST_ASSERT_DOUBLE_WITHIN(0.06 * std::abs(expected), expected, acceleration);
}

TEST(test_all_wheel_drive_climbs_to_the_friction_angle) {
  const BodySpec body = study_car(0.115);
  const double friction = 0.3, angle_rad = std::atan(friction), margin_rad = 2 * kPi / 180;
  TEST_ASSERT_TRUE(speed_on_slope_m_s(body, friction, angle_rad - margin_rad, 1, 2) > 0.1);
  TEST_ASSERT_TRUE(speed_on_slope_m_s(body, friction, angle_rad + margin_rad, 1, 2) < 0);
}

// Front wheels against a step, at rest: does the slow drive lift them onto it?
bool climbs_step(const BodySpec& body, double friction, double height_m, double fraction) {
  const SceneTerrain step(blocks({{1.0, 0, 1.0, 2.0, height_m, 0}}));
  const double touching_m = 0.5 - 0.07 - std::sqrt(0.06 * 0.06 - (0.06 - height_m) * (0.06 - height_m));
  Drive drive(body, friction, step, fraction, {}, {touching_m, 0, 0});
  double highest_rad = 0;
  for (int i = 0; i < 40; ++i) highest_rad = std::max(highest_rad, drive.run(0.1).pitch_rad);
  return highest_rad > 0.8 * std::asin(height_m / 0.14);
}

TEST(test_the_highest_step_climbed_is_the_one_statics_allow) {
  struct Case {
    double friction, stall_torque_n_m, fraction;
  };
  // Limited by friction, then by torque; driven so slowly or weakly that momentum lifts it a few millimetres only.
  for (const Case& limit : {Case{0.3, 0.134, 0.2}, Case{0.4, 0.134, 0.2}, Case{0.45, 0.134, 0.2},
                            Case{0.5, 0.134, 0.2}, Case{2, 0.010, 1}, Case{2, 0.015, 1}}) {
    BodySpec body = study_car(0.115);
    for (WheelSpec& wheel : body.wheels) wheel.servo.stall_torque_n_m = limit.stall_torque_n_m;
    const double highest_m = highest_climbable_step_m(body, limit.friction);
    TEST_ASSERT_TRUE(highest_m > 0.01 && highest_m < 0.055);
    TEST_ASSERT_TRUE(climbs_step(body, limit.friction, highest_m - 0.0005, limit.fraction));
    TEST_ASSERT_FALSE(climbs_step(body, limit.friction, highest_m + 0.005, limit.fraction));
  }
}

TEST(test_it_tips_where_its_weight_passes_the_outer_tyre) {
  for (const double width_m : {0.065, 0.095, 0.115}) {
    const BodySpec body = study_car(width_m);
    const double limit_rad = std::atan((body.track_m + 0.012) / (2 * CarConstants(body).com_height_m));
    // A few degrees short of the limit less than a millijoule tips it: putting it down may take it over.
    for (const double margin_rad : {-0.09, 0.02}) {
      // The left wheels on a bench as high as leans the car by that angle, its edge just inside their track.
      const double lean_rad = limit_rad + margin_rad;
      const double inner_m = 0.5 * body.track_m * std::cos(lean_rad) - 0.007;
      const SceneTerrain bench(blocks({{0, inner_m + 0.5, 4, 1, body.track_m * std::sin(lean_rad), 0}}));
      StepOptions gently;
      gently.drop_m = 0;
      Drive drive(body, 0.6, bench, 0, gently);
      double least_up = 1;
      for (int i = 0; i < 30; ++i) least_up = std::min(least_up, drive.run(0.1).up);
      TEST_ASSERT_EQUAL_INT(margin_rad > 0, least_up < 0.26);
    }
  }
}

// The left wheels on a bench: rolling about its contacts carries the axles a radius times sin(roll) to the right.
TEST(test_a_rolled_car_stands_beside_where_its_wheels_do_in_every_direction) {
  const BodySpec body = study_car(0.115);
  const double height_m = 0.04;
  for (const double heading_rad : {0.0, 1.0, 2.5, -1.2}) {
    const double c = std::cos(heading_rad), s = std::sin(heading_rad);
    const SceneTerrain bench(blocks({{-0.52 * s, 0.52 * c, 4, 1, height_m, heading_rad}}));
    Drive drive(body, 2, bench, 0, {}, {0, 0, heading_rad});
    const CarState start = drive.car.state();
    const CarState& state = drive.run(0.5);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, height_m / body.track_m, std::sin(state.roll_rad));
    TEST_ASSERT_DOUBLE_WITHIN(0.0015, 0.06 * std::sin(state.roll_rad) * s, state.x_m);
    TEST_ASSERT_DOUBLE_WITHIN(0.0015, -0.06 * std::sin(state.roll_rad) * c, state.y_m);
    TEST_ASSERT_DOUBLE_WITHIN(0.0015, start.x_m, state.x_m);
  }
}

// What its axles carry of a difference between left and right is told by their tyres, all alike, not by the solver.
TEST(test_a_rigid_car_loads_its_axles_alike) {
  BodySpec body = study_car(0.115);
  body.segments[0].com_y_m = 0.01;
  Drive drive(body, 0.6, kFlat, 0);
  const double share_n = body.segments[0].mass_kg * kGravity * 0.01 / body.track_m;  // of each axle's difference
  drive.run(1);
  for (int i = 0; i < 240; ++i) {
    drive.run(drive.car.step_s());
    for (const std::size_t left : {0, 2}) {
      const double difference_n = drive.car.wheel_load_n(left) - drive.car.wheel_load_n(left + 1);
      TEST_ASSERT_DOUBLE_WITHIN(0.1 * share_n, share_n, difference_n);
    }
  }
}

// Steady turn of a car whose right side is weaker: both sides' wheels follow their torque lines, the difference of
// their drives balances the tyres' scrub, and tyres that are dragged sideways creep along, for friction opposes their
// slip as a whole: forward slip is to sideways slip as drive is to scrub.
TEST(test_a_weaker_side_turns_it_as_scrub_and_torque_lines_balance) {
  BodySpec body = study_car(0.115);
  for (WheelSpec& wheel : body.wheels) {
    if (wheel.side == CarSide::kRight) wheel.servo.no_load_speed_rad_s *= 0.65;
  }
  const double friction = 0.6, weight_n = mass_kg(body) * kGravity, radius_m = 0.06, arm_m = 0.07;
  const double stall_n_m = body.wheels[0].servo.stall_torque_n_m;
  const double drive_n = scrub_drive_n(weight_n, friction, arm_m, body.track_m);
  const double loss = drive_n * radius_m / stall_n_m;
  const double left_rad_s = 11.5 * (1 - loss), right_rad_s = 0.65 * 11.5 * (1 + loss);
  const double creep_m = scrub_creep_m(drive_n, weight_n, friction, arm_m);
  const double expected_rad_s = (right_rad_s - left_rad_s) * radius_m / (body.track_m + 2 * creep_m);
  Drive drive(body, friction, kFlat, 1);
  drive.run(2);
  TEST_ASSERT_TRUE(expected_rad_s < 0);
  TEST_ASSERT_DOUBLE_WITHIN(0.1 * std::abs(expected_rad_s), expected_rad_s, drive.car.state().yaw_rate_rad_s);
}

TEST(test_without_slip_motor_work_becomes_mechanical_energy) {
  Drive drive(study_car(0.115), 2.0, kFlat, 0);
  drive.run(0.5);
  const double energy_j = drive.car.mechanical_energy_j(), work_j = drive.car.state().motor_work_j;
  drive.pulses_us = pulses_for(drive.body, 0.6);
  drive.run(0.15);
  const double gained_j = drive.car.mechanical_energy_j() - energy_j;
  const double done_j = drive.car.state().motor_work_j - work_j;
  TEST_ASSERT_TRUE(gained_j > 0.005);
  TEST_ASSERT_DOUBLE_WITHIN(0.05 * done_j, done_j, gained_j);
}

TEST(test_friction_and_impacts_never_give_energy) {
  const SceneTerrain bumps(blocks({{0.35, 0, 0.06, 2, 0.02, 0}, {0.75, 0, 0.06, 2, 0.02, 0}}));
  // Hitting an edge, a wheel enters it by a step's travel and is pushed out at no cost: short steps keep that
  // below the tolerance.
  StepOptions fine;
  fine.rate_hz = 960;
  constexpr double kTolerance_j = 0.004;
  BodySpec body = study_car(0.115);
  for (WheelSpec& wheel : body.wheels) wheel.servo.rotor_inertia_kg_m2 = 0;  // its energy is not the plane's
  Drive drive(body, 0.6, bumps, 1, fine);
  auto unexplained_j = [&] { return drive.car.mechanical_energy_j() - drive.car.state().motor_work_j; };
  drive.run(0.25);
  const double start_j = unexplained_j();
  double least_j = start_j;
  while (drive.car.state().x_m < 1.2) {
    drive.run(drive.car.step_s());
    TEST_ASSERT_TRUE(unexplained_j() < least_j + kTolerance_j);
    least_j = std::min(least_j, unexplained_j());
  }
  TEST_ASSERT_TRUE(least_j < start_j);
}

TEST(test_electrical_energy_covers_the_work) {
  Drive drive(study_car(0.115), 0.6, kFlat, 1);
  const CarState& state = drive.run(1);
  TEST_ASSERT_TRUE(state.motor_work_j > 0);
  TEST_ASSERT_TRUE(state.consumed_energy_j > state.motor_work_j);
}

// The torque that spins up the geared rotors never reaches the wheels, nor the frame: only what drives the car
// may lift its nose, which is a hundredth of a radian. A frame that took all of it would rear up.
TEST(test_spinning_up_the_rotors_does_not_lift_the_nose) {
  BodySpec body = study_car(0.115);
  for (WheelSpec& wheel : body.wheels) wheel.servo.rotor_inertia_kg_m2 = 5e-4;
  Drive drive(body, 0.6, kFlat, 0);
  drive.run(0.3);
  drive.pulses_us = pulses_for(body, 1);
  double highest_rad = 0;
  for (int i = 0; i < 120; ++i) highest_rad = std::max(highest_rad, drive.run(drive.car.step_s()).pitch_rad);
  TEST_ASSERT_TRUE(highest_rad < 0.02);
}
