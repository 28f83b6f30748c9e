// Box2D's car in its side plane against closed forms: fall, landing, slopes, steps, energy, hinges, ground, trials.
#include "../../suite.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "../../closed_form_tests.h"
#include "side_view_engine.h"
#include "trial.h"

using namespace foldcar;

namespace {

using Drive = DriveOf<SideViewCar, SideViewOptions>;
SideViewOptions gently(double rate_hz = 240) { return create_gently<SideViewOptions>(rate_hz); }
const Nearness<SideViewOptions> kNear{0.006, 0.001, 0.005, true, 0.05, gently(960), false, gently(960)};

}  // namespace

TEST(test_it_falls_as_bodies_do_and_lands_without_a_jump) {
  const BodySpec body = study_car(0.115);
  SideViewOptions high;
  high.drop_m = 0.3;
  Drive drive(body, scene_of({}, 0.6), 0, high);
  const double start_m = drive.car.state().z_m, time_s = 0.2;
  const double fallen_m = 0.5 * kGravity * time_s * (time_s + drive.step_s);
  TEST_ASSERT_DOUBLE_WITHIN(0.002 * fallen_m, fallen_m, start_m - drive.run(time_s).z_m);
  const double energy_j = drive.car.mechanical_energy_j();
  drive.run(0.1);
  double highest_m = 0;
  for (int i = 0; i < 100; ++i) highest_m = std::max(highest_m, drive.run(drive.step_s).z_m);
  TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.06, highest_m);
  const double lost_j = mass_kg(body) * kGravity * (start_m - fallen_m - 0.06) +
                        0.5 * mass_kg(body) * std::pow(kGravity * time_s, 2);
  TEST_ASSERT_DOUBLE_WITHIN(0.02 * lost_j, lost_j, energy_j - drive.car.mechanical_energy_j());
}

TEST(test_its_wheels_share_its_weight_by_their_levers) {
  BodySpec body = study_car(0.115);
  body.segments[0].com_x_m = 0.02;
  Drive drive(body, scene_of({}, 0.6), 0);
  drive.run(2);
  const double weight_n = mass_kg(body) * kGravity;
  const double front_n = 0.5 * weight_n + body.segments[0].mass_kg * kGravity * 0.02 / 0.14;
  TEST_ASSERT_DOUBLE_WITHIN(0.01 * weight_n, front_n, drive.car.pair_load_n(0));
  TEST_ASSERT_DOUBLE_WITHIN(0.01 * weight_n, weight_n - front_n, drive.car.pair_load_n(3));
}

TEST_CLOSED_FORMS(Drive, kNear);

// The speeds of a strong and a weak servo on one axle meet where their torques cancel.
TEST(test_unlike_servos_of_a_pair_drive_it_together) {
  BodySpec body = study_car(0.115);
  for (WheelSpec& wheel : body.wheels) {
    if (wheel.side == CarSide::kRight) wheel.servo.no_load_speed_rad_s = 8;
  }
  Drive drive(body, scene_of({}, 0.6), 1);
  const double expected_rad_s = 2 / (1 / 11.5 + 1 / 8.0);  // equal stall torques
  TEST_ASSERT_DOUBLE_WITHIN(0.01 * expected_rad_s * 0.06, expected_rad_s * 0.06, drive.run(2).speed_m_s);
  TEST_ASSERT_DOUBLE_WITHIN(0.01 * expected_rad_s, expected_rad_s, drive.car.wheel_speed_rad_s(1));
}

// The reaction of its rotors comes some steps late.
TEST(test_its_rotors_hardly_pitch_it) {
  TEST_ASSERT_TRUE(largest_pitch_rad<Drive>(1) < 0.025);
  TEST_ASSERT_TRUE(largest_pitch_rad<Drive>(-1) < 0.06);
}

// Free wheels under a car of two halves: each turns about its axle under its weight, 20 mm from it, and the flexure.
TEST(test_a_hinge_sags_as_its_stiffness_lets_it_and_rests_on_its_limits) {
  const BodySpec body = without_rotors(hinged_study_car(0.095, 0.6));
  Drive drive(body, scene_of({}, 0.6), kNoPulses, gently());
  const double sag_rad = HingedHalf(body).sag_rad();
  drive.run(3);
  TEST_ASSERT_DOUBLE_WITHIN(0.015 * sag_rad, sag_rad, std::abs(drive.car.hinge_rad(0)));
  for (const double limit_rad : {0.05, 0.2}) {
    Drive limp(without_rotors(hinged_study_car(0.095, 0, limit_rad)), scene_of({}, 0.6), kNoPulses, gently());
    limp.run(2);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, limit_rad, std::abs(limp.car.hinge_rad(0)));
  }
}

// Within the limit it sinks by less than a millimetre, beyond it is refused.
TEST(test_a_segment_too_heavy_for_its_wheels_is_refused) {
  BodySpec body = study_car(0.095);
  const double pair_kg = 2 * body.wheels[0].mass_kg;
  body.segments[0].mass_kg = 99 * pair_kg;
  Drive drive(body, scene_of({}, 0.6), 0);
  TEST_ASSERT_DOUBLE_WITHIN(0.001, 0.06, drive.run(2).z_m);
  body.segments[0].mass_kg = 101 * pair_kg;
  std::string refusal;
  try {
    Drive(body, scene_of({}, 0.6), 0);
  } catch (const std::runtime_error& error) {
    refusal = error.what();
  }
  TEST_ASSERT_TRUE(refusal.find("more than 100 times as heavy") != std::string::npos);
}

// The belly's lower corner, 11 mm high, meets the slope a few millimetres before the plateau's wall behind it. Sliding up
// it loses speed to the inelastic impact and to friction, but the wall is inside the slope.
TEST(test_a_belly_slides_up_a_slope_onto_the_plateau_behind_it) {
  BodySpec body = study_car(0.095);
  for (WheelSpec& wheel : body.wheels) wheel.radius_m = 0.036;
  for (const double length_m : {0.016, 0.02}) {
    for (const double height_m : {0.012, 0.0128, 0.0136}) {
      const BlockSpec slope{0.4, 0, length_m, 2, height_m, 0, BlockSpec::Kind::kRamp};
      const BlockSpec plateau{0.4 + length_m / 2 + 0.25, 0, 0.5, 2, height_m, 0};
      Drive drive(body, scene_of(blocks({slope, plateau}), 0.8), 1);
      while (drive.car.state().x_m < 0.28) drive.run(drive.step_s);
      TEST_ASSERT_TRUE(drive.run(0.5).x_m > 0.37);
    }
  }
}

// On the crest of a ridge a limp car of three axles folds until every wheel stands; a stiff one bridges it.
TEST(test_hinges_let_every_wheel_stand_on_a_crest) {
  for (const double stiffness : {0.0, 1e5}) {
    const BodySpec body = three_segment_car(0.095, stiffness, 0.002);
    Drive drive(body, scene_of(blocks({{0, 0, 0.05, 2, 0.02, 0}}), 0.6), kNoPulses, gently());
    drive.run(3);
    const double least_n = std::min(drive.car.pair_load_n(0), drive.car.pair_load_n(4));
    TEST_ASSERT_TRUE(drive.car.pair_load_n(2) > 0.3);
    TEST_ASSERT_EQUAL_INT(stiffness == 0, least_n > 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(0.002, stiffness == 0 ? 0.08 : drive.car.state().z_m, drive.car.state().z_m);
  }
}

TEST(test_it_follows_smooth_ground_over_the_seams_of_its_pieces) {
  TerrainSpec terrain;
  terrain.hills.push_back({1.0, 0, 0, 0.5, 5, 0.08});
  const BodySpec body = study_car(0.095);
  Drive drive(body, scene_of(terrain, 0.9, {-0.5, 0, 0}), 0.6);
  drive.run(0.3);
  while (drive.car.state().x_m < 2.5) {
    const CarState& state = drive.run(drive.step_s);
    // Each axle stands a radius above the ground along its normal.
    const auto axle_m = [&](double x_m) {
      double above_m = 0;
      for (double dx = -0.06; dx <= 0.06; dx += 0.001) {
        above_m = std::max(above_m, drive.terrain.height_m(x_m + dx, 0) + std::sqrt(0.0036 - dx * dx));
      }
      return above_m;
    };
    const double c = 0.07 * std::cos(state.pitch_rad), s = 0.07 * std::sin(state.pitch_rad);
    TEST_ASSERT_DOUBLE_WITHIN(0.0012, axle_m(state.x_m + c), state.z_m + s);
    TEST_ASSERT_DOUBLE_WITHIN(0.0012, axle_m(state.x_m - c), state.z_m - s);
  }
}

TEST(test_any_heading_and_place_of_the_start_gives_the_same_run) {
  const BodySpec body = study_car(0.095);
  const auto result = [&](double x_m, double y_m, double heading_rad) {
    const double c = std::cos(heading_rad), s = std::sin(heading_rad);
    SceneSpec scene = scene_of(blocks({{x_m + 0.4 * c, y_m + 0.4 * s, 0.06, 2, 0.02, heading_rad}}), 0.6,
                               {x_m, y_m, heading_rad});
    scene.goal = GoalSpec{GoalSpec::Kind::kLine, x_m + c, y_m + s, heading_rad, 0};
    const TrialSpec trial = full_speed(body);
    return run_trial(SideViewEngine(), body, scene, trial, nullptr, nullptr);
  };
  const TrialResult first = result(0, 0, 0), turned = result(1, -2, 2.1);
  TEST_ASSERT_EQUAL_INT(static_cast<int>(Outcome::kPassed), static_cast<int>(first.outcome));
  TEST_ASSERT_EQUAL_INT(static_cast<int>(Outcome::kPassed), static_cast<int>(turned.outcome));
  TEST_ASSERT_DOUBLE_WITHIN(0.01, first.elapsed_time_s, turned.elapsed_time_s);
  TEST_ASSERT_DOUBLE_WITHIN(0.02 * first.consumed_energy_j, first.consumed_energy_j, turned.consumed_energy_j);
  TEST_ASSERT_TRUE(result(0, 0, 0).elapsed_time_s == first.elapsed_time_s);
}
