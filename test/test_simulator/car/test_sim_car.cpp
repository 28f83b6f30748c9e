// The car's physics against closed forms: fall, friction, torque-speed line, steps, tip-over, yaw, energy.
#include "../../suite.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "../multibody_bench.h"

using namespace foldcar;

namespace {

StepOptions fine() {
  StepOptions options;
  options.rate_hz = 960;
  return options;
}

const Nearness<StepOptions> kNear{0.012, 0.0005, 0.005, true, 0.05, {}, false, fine()};

// What scrub takes from the drive of each outer wheel, and gives to each inner one, in a steady turn (N): tyres at
// axle_m from the middle slide sideways with the friction that driving leaves them.
double scrub_drive_n(double weight_n, double friction, double axle_m, double track_m) {
  double drive_n = 0;
  for (int i = 0; i < 200; ++i) {
    const double share = drive_n / (friction * weight_n / 4);
    const double scrub_n_m = friction * weight_n * axle_m * std::sqrt(std::max(0.0, 1 - share * share));
    drive_n += 0.5 * (scrub_n_m / (2 * track_m) - drive_n);
  }
  return drive_n;
}

}  // namespace

TEST(test_it_falls_as_bodies_do) {
  StepOptions options;
  options.drop_m = 1;
  for (const double time_s : {0.1, 0.2, 0.4}) {
    Drive drive(study_car(0.115), scene_of({}, 0.6), 0, options);
    const double start_m = drive.car.state().z_m;
    const CarState& state = drive.run(time_s);
    // The integrator is ahead by half a step's worth of speed.
    const double fallen_m = 0.5 * kGravity * time_s * (time_s + drive.step_s);
    TEST_ASSERT_DOUBLE_WITHIN(0.001 * fallen_m, fallen_m, start_m - state.z_m);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0, state.pitch_rad);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0, state.roll_rad);
  }
}

TEST_CLOSED_FORMS(Drive, kNear);

TEST(test_it_neither_sinks_nor_slows_far_from_where_it_started) {
  Drive drive(study_car(0.095), scene_of({}, 0.6), 1);
  const CarState early = drive.run(5);
  const CarState& late = drive.run(75);
  TEST_ASSERT_TRUE(late.x_m > 40);
  TEST_ASSERT_DOUBLE_WITHIN(1e-4, early.z_m, late.z_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-3 * early.speed_m_s, early.speed_m_s, late.speed_m_s);
}

TEST(test_friction_holds_braked_wheels_up_to_its_angle_and_no_further) {
  BodySpec body = study_car(0.115);
  for (WheelSpec& wheel : body.wheels) wheel.servo.stall_torque_n_m = 0.5;  // neutral holds almost as a lock does
  const double friction = 0.3, angle_rad = std::atan(friction), margin_rad = 3 * kPi / 180;
  const double below_rad = angle_rad - margin_rad;
  TEST_ASSERT_DOUBLE_WITHIN(0.006, no_slip_speed_m_s(body, below_rad, 0),
                            speed_on_slope_m_s<Drive>(body, friction, below_rad, 0, 1.5));
  // Beyond, it slides with what friction leaves of gravity.
  const double beyond_rad = angle_rad + 3 * margin_rad, early_s = 0.25, late_s = 0.65;
  const double acceleration = (speed_on_slope_m_s<Drive>(body, friction, beyond_rad, 0, late_s) -
                               speed_on_slope_m_s<Drive>(body, friction, beyond_rad, 0, early_s)) /
                              (late_s - early_s);
  const double expected = -kGravity * (std::sin(beyond_rad) - friction * std::cos(beyond_rad));
  TEST_ASSERT_DOUBLE_WITHIN(0.06 * std::abs(expected), expected, acceleration);
}

// Its left wheels on a bench: the weight passes the right tyre's outer edge, further from it the more it is to the left.
TEST(test_it_tips_where_its_weight_passes_the_outer_tyre) {
  for (const auto& [width_m, com_y_m] : {std::pair(0.065, 0.0), std::pair(0.115, 0.0), std::pair(0.095, 0.01)}) {
    BodySpec body = study_car(width_m);
    body.segments[0].com_y_m = com_y_m;
    const double aside_m = com_y_m * body.segments[0].mass_kg / mass_kg(body);
    const double limit_rad =
        std::atan((0.5 * (body.track_m + 0.012) + aside_m) / CarConstants(body).com_height_m);
    // A few degrees short of the limit less than a millijoule tips it: putting it down may take it over.
    for (const double margin_rad : {-0.09, 0.02}) {
      // As high as leans the car by that angle, its edge just inside the wheels' track.
      const double lean_rad = limit_rad + margin_rad;
      const double inner_m = 0.5 * body.track_m * std::cos(lean_rad) - 0.007;
      const TerrainSpec bench = blocks({{0, inner_m + 0.5, 4, 1, body.track_m * std::sin(lean_rad), 0}});
      Drive drive(body, scene_of(bench, 0.6), 0, gently());
      double least_up = 1;
      for (int i = 0; i < 30; ++i) least_up = std::min(least_up, drive.run(0.1).up);
      TEST_ASSERT_EQUAL_INT(margin_rad > 0, least_up < 0.26);
    }
  }
}

// What its axles carry of a difference between left and right is told by their tyres, all alike, not by the solver.
TEST(test_a_rigid_car_loads_its_axles_alike) {
  BodySpec body = study_car(0.115);
  body.segments[0].com_y_m = 0.01;
  Drive drive(body, scene_of({}, 0.6), 0);
  const double share_n = body.segments[0].mass_kg * kGravity * 0.01 / body.track_m;  // of each axle's difference
  drive.run(1);
  for (int i = 0; i < 240; ++i) {
    drive.run(drive.step_s);
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
  // How far each side creeps along the ground for every radian of the turn.
  const double creep_m = arm_m * drive_n / std::sqrt(std::pow(friction * weight_n / 4, 2) - drive_n * drive_n);
  const double expected_rad_s = (right_rad_s - left_rad_s) * radius_m / (body.track_m + 2 * creep_m);
  Drive drive(body, scene_of({}, friction), 1);
  drive.run(2);
  TEST_ASSERT_TRUE(expected_rad_s < 0);
  TEST_ASSERT_DOUBLE_WITHIN(0.1 * std::abs(expected_rad_s), expected_rad_s, drive.car.state().yaw_rate_rad_s);
}

TEST(test_its_rotors_do_not_lift_its_nose) {
  for (const double fraction : {1.0, -1.0}) TEST_ASSERT_TRUE(largest_pitch_rad<Drive>(fraction) < 0.02);
}
