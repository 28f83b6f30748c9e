// Cars of several segments against closed forms: sag, swing, limits, energy, the rigid limit, 2 to 8 wheels.
#include "../../suite.h"

#include <algorithm>
#include <cmath>

#include "../multibody_bench.h"

using namespace foldcar;

namespace {

// The solver's spring damps by stiffness times step: little at this rate.
constexpr double kFineRate_hz = 1920;
constexpr double kWidth_m = 0.095;

BodySpec three_segments(double stiffness_n_m_rad) { return three_segment_car(kWidth_m, stiffness_n_m_rad); }

double total_load_n(const Drive& drive) {
  double load_n = 0;
  for (std::size_t i = 0; i < drive.body.wheels.size(); ++i) load_n += drive.car.wheel_load_n(i);
  return load_n;
}

}  // namespace

// Mass, moments and products about the car's origin simply add up; Steiner's theorem brings them to the centre of mass.
// Roll and yaw are taken about axes through the segments' own middle: that wheels stand beside and below it is left out.
TEST(test_the_constants_of_unlike_segments_are_those_of_their_sum) {
  BodySpec body = three_segments(1);
  const double masses_kg[] = {0.05, 0.14, 0.09}, sides_m[] = {-0.009, 0.017, 0}, heights_m[] = {0.031, -0.012, 0.008};
  double mass_kg = 0, x = 0, y = 0, z = 0, roll = 0, yaw = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    SegmentSpec& s = body.segments[i];
    s.mass_kg = masses_kg[i];
    s.com_y_m = sides_m[i];
    s.com_z_m = heights_m[i];
    mass_kg += s.mass_kg;
    x += s.mass_kg * s.com_x_m;
    y += s.mass_kg * s.com_y_m;
    z += s.mass_kg * s.com_z_m;
    roll += s.roll_inertia_kg_m2 + s.mass_kg * (s.com_y_m * s.com_y_m + s.com_z_m * s.com_z_m);
    yaw += s.yaw_inertia_kg_m2 + s.mass_kg * (s.com_x_m * s.com_x_m + s.com_y_m * s.com_y_m);
  }
  const double segments_kg = mass_kg, half_track_m = 0.5 * body.track_m;
  for (const WheelSpec& w : body.wheels) {
    const double disc = 0.25 * w.mass_kg * w.radius_m * w.radius_m;
    mass_kg += w.mass_kg;
    x += w.mass_kg * w.x_m;
    roll += disc + w.mass_kg * half_track_m * half_track_m;
    yaw += disc + w.mass_kg * (w.x_m * w.x_m + half_track_m * half_track_m);
  }
  const CarConstants constants(body);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, mass_kg, constants.mass_kg);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, x / mass_kg, constants.com_x_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, y, constants.side_moment_kg_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.06 + z / mass_kg, constants.com_height_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, roll - (y * y + z * z) / segments_kg, constants.roll_inertia_kg_m2);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, yaw - x * x / mass_kg - y * y / segments_kg, constants.yaw_inertia_kg_m2);
}

TEST(test_a_hinge_sags_as_its_stiffness_lets_it) {
  for (const double stiffness : {0.05, 0.15, 0.5}) {
    BodySpec body = hinged_study_car(kWidth_m, stiffness);
    body.hinges[0].damping_n_m_s_rad = 0.003;
    Drive drive(body, kFlat, kNoPulses);
    drive.run(3);
    const double sag_rad = HingedHalf(body).sag_rad();
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * sag_rad + 0.001, sag_rad, drive.car.hinge_rad(0));
  }
}

TEST(test_a_hinge_swings_at_its_natural_frequency_without_gaining_energy) {
  const BodySpec body = without_rotors(hinged_study_car(kWidth_m, 0.15));
  const HingedHalf half(body);
  Drive drive(body, kFlat, kNoPulses, gently(kFineRate_hz));
  const double start_j = drive.car.mechanical_energy_j();
  // Put down flat, it swings about its sag; crossings upwards are one period apart.
  double first_s = -1, last_s = -1, highest_rad = 0;
  int crossings = 0;
  double before_rad = 0;
  for (int i = 0; i < kFineRate_hz; ++i) {
    drive.run(drive.step_s);
    const double fold_rad = drive.car.hinge_rad(0);
    if (before_rad < half.sag_rad() && fold_rad >= half.sag_rad()) {
      const double share = (half.sag_rad() - before_rad) / (fold_rad - before_rad);
      last_s = (i + share) * drive.step_s;
      if (crossings++ == 0) first_s = last_s;
    }
    before_rad = fold_rad;
    highest_rad = std::max(highest_rad, fold_rad);
    TEST_ASSERT_TRUE(drive.car.mechanical_energy_j() < start_j + 2e-5);
  }
  const double period_s = (last_s - first_s) / (crossings - 1);
  TEST_ASSERT_TRUE(crossings > 4);
  TEST_ASSERT_DOUBLE_WITHIN(0.03 * 2 * kPi / half.swing_rad_s(), 2 * kPi / half.swing_rad_s(), period_s);
  // Without losses the first swing goes to twice the sag.
  TEST_ASSERT_DOUBLE_WITHIN(0.1 * half.sag_rad(), 2 * half.sag_rad(), highest_rad);
}

TEST(test_damping_takes_its_share_of_each_swing) {
  BodySpec body = without_rotors(hinged_study_car(kWidth_m, 0.15));
  const HingedHalf half(body);
  const double ratio = 0.1;
  body.hinges[0].damping_n_m_s_rad = ratio * half.swing_rad_s() * half.inertia_kg_m2;  // acts on twice the tilt
  Drive drive(body, kFlat, kNoPulses, gently(kFineRate_hz));
  // The third overshoot of the sag after the start, 2.5 periods of decay.
  const double period_s = 2 * kPi / (half.swing_rad_s() * std::sqrt(1 - ratio * ratio));
  drive.run(2 * period_s);
  double peak_rad = 0;
  for (int i = 0; i < period_s / drive.step_s; ++i) {
    drive.run(drive.step_s);
    peak_rad = std::max(peak_rad, drive.car.hinge_rad(0));
  }
  const double solver_ratio = 0.5 * half.swing_rad_s() / kFineRate_hz;
  const double expected = std::exp(-2.5 * period_s * (ratio + solver_ratio) * half.swing_rad_s());
  TEST_ASSERT_DOUBLE_WITHIN(0.2 * expected, expected, peak_rad / half.sag_rad() - 1);
}

TEST(test_a_limp_hinge_rests_on_its_limits) {
  BodySpec sagging = hinged_study_car(kWidth_m, 1e-6, 0.3);
  BodySpec drooping = sagging;
  for (WheelSpec& wheel : drooping.wheels) wheel.x_m *= 0.03 / 0.07;  // inside of where the weight is
  Drive down(sagging, kFlat, kNoPulses), up(drooping, kFlat, kNoPulses);
  down.run(2);
  up.run(2);
  TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.3, down.car.hinge_rad(0));
  TEST_ASSERT_DOUBLE_WITHIN(0.01, -0.3, up.car.hinge_rad(0));
}

TEST(test_a_very_stiff_hinge_is_none) {
  const SceneSpec bumps = scene_of(blocks({{0.4, 0, 0.06, 2, 0.02, 0}, {0.9, 0.3, 0.2, 0.6, 0.03, 0}}), 0.6);
  const BodySpec rigid = study_car(kWidth_m), stiff = hinged_study_car(kWidth_m, 1000);
  Drive one(rigid, bumps, 0.4), two(stiff, bumps, 0.4);
  for (int i = 0; i < 30; ++i) {
    const CarState& expected = one.run(0.1);
    const CarState& state = two.run(0.1);
    TEST_ASSERT_DOUBLE_WITHIN(0.005, expected.x_m, state.x_m);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, expected.pitch_rad, state.pitch_rad);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, expected.roll_rad, state.roll_rad);
    TEST_ASSERT_DOUBLE_WITHIN(0.005, 0, two.car.hinge_rad(0));
  }
  TEST_ASSERT_TRUE(two.car.state().x_m > 0.6);
}

TEST(test_hinges_let_every_wheel_stand_on_a_step_under_the_middle_axle) {
  const SceneSpec block = scene_of(blocks({{0, 0, 0.06, 2, 0.02, 0}}), 0.6);
  Drive limp(three_segments(1e-3), block, kNoPulses), rigid(three_segments(1000), block, kNoPulses);
  limp.run(2);
  rigid.run(2);
  const double weight_n = CarConstants(limp.body).mass_kg * kGravity;
  TEST_ASSERT_DOUBLE_WITHIN(0.02 * weight_n, weight_n, total_load_n(limp));
  TEST_ASSERT_DOUBLE_WITHIN(0.02 * weight_n, weight_n, total_load_n(rigid));
  for (std::size_t i = 0; i < 6; ++i) TEST_ASSERT_TRUE(limp.car.wheel_load_n(i) > 0.1 * weight_n);
  // The rigid one rocks on its middle axle: its front or its rear hangs in the air.
  TEST_ASSERT_TRUE(std::min(rigid.car.wheel_load_n(0), rigid.car.wheel_load_n(4)) < 0.001 * weight_n);
  // Front and rear stand 20 mm lower, 70 mm from their hinges.
  const double slope_rad = std::asin(0.02 / 0.07);
  // The middle one may tilt on its axle, which adds to one fold what it takes from the other.
  TEST_ASSERT_DOUBLE_WITHIN(0.02, -slope_rad, 0.5 * (limp.car.hinge_rad(0) + limp.car.hinge_rad(1)));
}

TEST(test_a_hinged_car_crosses_bumps_without_gaining_energy) {
  gains_no_energy_by_friction_and_impacts<Drive>(without_rotors(three_segments(0.1)), gently(960));
}

// Two wheels in front and a belly that drags: the load at its rear edge follows from the weight, its friction from
// the load, the speed from the torque line.
TEST(test_one_axle_pulls_its_belly_along) {
  BodySpec body = study_car(kWidth_m);
  body.wheels.resize(2);
  const double weight_n = CarConstants(body).mass_kg * kGravity, radius_m = 0.06, friction = 0.35;
  const double axle_m = 0.07, edge_m = -0.1;
  const double drag_n = friction * weight_n * (axle_m - CarConstants(body).com_x_m) / (axle_m - edge_m);
  const ServoSpec& servo = body.wheels[0].servo;
  const double speed_m_s = radius_m * servo.no_load_speed_rad_s * (1 - drag_n * radius_m / (2 * servo.stall_torque_n_m));
  Drive drive(body, kFlat, 1);
  drive.run(2);
  TEST_ASSERT_DOUBLE_WITHIN(0.03 * speed_m_s, speed_m_s, drive.car.state().speed_m_s);
  // The tail's lower edge comes down to the ground from where 25 mm of belly and 60 mm of wheel hold it.
  const double tilt_rad = std::asin(0.06 / std::hypot(0.17, 0.025)) - std::atan2(0.025, 0.17);
  TEST_ASSERT_DOUBLE_WITHIN(0.01, tilt_rad, drive.car.state().pitch_rad);
  // A hundredth of its way: the solver takes left before right, and what drags behind steers.
  TEST_ASSERT_DOUBLE_WITHIN(0.01, 0, drive.car.state().y_m);
}

TEST(test_up_to_eight_wheels_carry_the_car_and_drive_it_at_their_speed) {
  BodySpec eight = three_segments(0.1);
  BodySpec four_axles = study_car(kWidth_m);
  four_axles.wheels.clear();
  for (int i = 0; i < 8; ++i) {
    WheelSpec wheel = study_car(kWidth_m).wheels[static_cast<std::size_t>(i % 2)];
    wheel.channel = i;
    wheel.x_m = 0.09 - 0.06 * (i / 2);
    wheel.radius_m = 0.028;
    four_axles.wheels.push_back(wheel);
  }
  for (const BodySpec& body : {eight, four_axles}) {
    Drive drive(body, kFlat, 1);
    drive.run(2);
    const double top_m_s = body.wheels[0].radius_m * body.wheels[0].servo.no_load_speed_rad_s;
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * top_m_s, top_m_s, drive.car.state().speed_m_s);
    const double weight_n = CarConstants(body).mass_kg * kGravity;
    TEST_ASSERT_DOUBLE_WITHIN(0.05 * weight_n, weight_n, total_load_n(drive));
  }
}

// Behind a body that slides without friction, two wheels on a segment far lighter than their rotors.
TEST(test_a_segment_lighter_than_its_rotors_drives_steadily) {
  BodySpec body = hinged_study_car(kWidth_m, 0.1);
  body.wheels.erase(body.wheels.begin(), body.wheels.begin() + 2);
  body.segments[0].grip = 0;
  SegmentSpec& rear = body.segments[1];
  rear.mass_kg = 0.025;
  rear.pitch_inertia_kg_m2 = 2e-5;
  const double top_m_s = body.wheels[0].radius_m * body.wheels[0].servo.no_load_speed_rad_s;
  TEST_ASSERT_TRUE(2 * body.wheels[0].servo.rotor_inertia_kg_m2 > 10 * rear.pitch_inertia_kg_m2);
  Drive drive(body, kFlat, 1);
  TEST_ASSERT_DOUBLE_WITHIN(0.03 * top_m_s, top_m_s, drive.run(2.5).speed_m_s);
}
