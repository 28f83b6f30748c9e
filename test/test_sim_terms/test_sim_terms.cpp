// The terms of the model on their own: servo line, roll couples, friction circle, Euler angles.
#include <unity.h>

#include <cmath>

#include "../study_car.h"
#include "servo_model.h"
#include "side_view_terms.h"

using namespace foldcar;

void setUp() {}
void tearDown() {}

namespace {

const ServoSpec kServo = {0.134, 11.5, 5.2, 0.7, 0.11, 2e-4, 1500, 45, 200, 1};

double torque_n_m(double pulse_us, double omega_rad_s, double supply_v = 5.2) {
  return servo_torque_n_m(kServo, servo_drive(kServo, pulse_us), omega_rad_s, supply_v);
}

}  // namespace

void test_a_pulse_within_the_deadband_asks_for_standstill() {
  for (const double pulse_us : {1456.0, 1500.0, 1544.0}) {
    TEST_ASSERT_TRUE(servo_drive(kServo, pulse_us).powered);
    TEST_ASSERT_EQUAL_DOUBLE(0, servo_drive(kServo, pulse_us).fraction);
  }
}

void test_speed_grows_linearly_beyond_the_deadband_and_saturates() {
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5, servo_drive(kServo, 1500 + 45 + 77.5).fraction);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.5, servo_drive(kServo, 1500 - 45 - 77.5).fraction);
  TEST_ASSERT_EQUAL_DOUBLE(1, servo_drive(kServo, 1700).fraction);
  TEST_ASSERT_EQUAL_DOUBLE(1, servo_drive(kServo, 2000).fraction);
  TEST_ASSERT_EQUAL_DOUBLE(-1, servo_drive(kServo, 1000).fraction);
}

void test_a_mirrored_servo_turns_the_other_way() {
  ServoSpec mirrored = kServo;
  mirrored.direction = -1;
  TEST_ASSERT_EQUAL_DOUBLE(-1, servo_drive(mirrored, 1700).fraction);
}

void test_torque_is_a_line_from_stall_to_no_load() {
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.134, torque_n_m(1700, 0));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.067, torque_n_m(1700, 5.75));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, torque_n_m(1700, 11.5));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.134, torque_n_m(1300, 0));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.067, torque_n_m(1500, 5.75));  // neutral brakes
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.134, torque_n_m(1300, 11.5));  // never more than stall torque
}

void test_torque_and_speed_follow_the_supply() {
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.134 * 0.8, torque_n_m(1700, 0, 0.8 * 5.2));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, torque_n_m(1700, 0.8 * 11.5, 0.8 * 5.2));
}

void test_without_pulses_there_is_neither_torque_nor_current() {
  const ServoDrive off = servo_drive(kServo, kNoPulse);
  TEST_ASSERT_FALSE(off.powered);
  TEST_ASSERT_EQUAL_DOUBLE(0, servo_torque_n_m(kServo, off, 5, 5.2));
  TEST_ASSERT_EQUAL_DOUBLE(0, servo_current_a(kServo, off, 0));
}

void test_current_runs_from_free_to_stall() {
  const ServoDrive full = servo_drive(kServo, 1700);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.11, servo_current_a(kServo, full, 0));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.70, servo_current_a(kServo, full, 0.134));
}

void test_the_weight_couple_is_that_of_a_point_mass_over_the_tyres_edge() {
  const double mass_kg = 0.2, height_m = 0.063, tyre_m = 0.012, roll_rad = 0.4;
  const double lever_m = height_m * std::tan(roll_rad) - tyre_m / 2;
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, mass_kg * 9.81 * lever_m,
                            weight_roll_couple_n_m(mass_kg, height_m, tyre_m, std::sin(roll_rad)));
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, -mass_kg * 9.81 * lever_m,
                            weight_roll_couple_n_m(mass_kg, height_m, tyre_m, -std::sin(roll_rad)));
}

void test_turning_left_presses_the_right_side_down() {
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.2 * 0.063 * 0.6 * 1.5, turning_roll_couple_n_m(0.2, 0.063, 0.6, 1.5));
}

void test_driving_and_sliding_share_one_friction_circle() {
  TEST_ASSERT_EQUAL_DOUBLE(1, friction_circle(0));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.6, friction_circle(0.8));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.2, friction_circle(1));
}

// A rolled and pitched body turns by small angles about its own left and up axes; its forward axis then tells
// heading and pitch.
void test_a_heading_step_is_that_of_the_rotated_body() {
  const double pitch = 0.3, roll = -0.4, about_up = 1e-6, about_left = 3e-6;
  const double forward[3] = {std::cos(pitch), 0, std::sin(pitch)};
  const double left[3] = {-std::sin(pitch) * std::sin(roll), std::cos(roll), std::cos(pitch) * std::sin(roll)};
  const double up[3] = {-std::sin(pitch) * std::cos(roll), -std::sin(roll), std::cos(pitch) * std::cos(roll)};
  double turned[3];
  for (int i = 0; i < 3; ++i) turned[i] = forward[i] + about_up * left[i] - about_left * up[i];
  const double d_heading = std::atan2(turned[1], turned[0]);
  const double d_pitch = std::atan2(turned[2], std::hypot(turned[0], turned[1])) - pitch;
  TEST_ASSERT_DOUBLE_WITHIN(1e-11, d_heading, heading_step_rad(about_up, d_pitch, pitch, std::sin(roll)));
}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_pulse_within_the_deadband_asks_for_standstill);
  RUN_TEST(test_speed_grows_linearly_beyond_the_deadband_and_saturates);
  RUN_TEST(test_a_mirrored_servo_turns_the_other_way);
  RUN_TEST(test_torque_is_a_line_from_stall_to_no_load);
  RUN_TEST(test_torque_and_speed_follow_the_supply);
  RUN_TEST(test_without_pulses_there_is_neither_torque_nor_current);
  RUN_TEST(test_current_runs_from_free_to_stall);
  RUN_TEST(test_the_weight_couple_is_that_of_a_point_mass_over_the_tyres_edge);
  RUN_TEST(test_turning_left_presses_the_right_side_down);
  RUN_TEST(test_driving_and_sliding_share_one_friction_circle);
  RUN_TEST(test_a_heading_step_is_that_of_the_rotated_body);
  UNITY_END();
  return 0;
}
