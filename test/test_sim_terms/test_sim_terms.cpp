// The terms of the model on their own: servo line, roll couples, sliding sideways and turning.
#include <unity.h>

#include <cmath>

#include "../study_car.h"
#include "servo_model.h"
#include "lateral_dynamics.h"
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
  TEST_ASSERT_EQUAL_DOUBLE(0, off.fraction);
  TEST_ASSERT_EQUAL_DOUBLE(0, servo_torque_n_m(kServo, off, 5, 5.2));
  TEST_ASSERT_EQUAL_DOUBLE(0, servo_current_a(kServo, off, 0));
}

void test_current_runs_from_free_to_stall() {
  const ServoDrive full = servo_drive(kServo, 1700);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.11, servo_current_a(kServo, full, 0));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.70, servo_current_a(kServo, full, 0.134));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.70, servo_current_a(kServo, full, -0.134));  // braking draws as much
  const ServoDrive half_back{true, -0.5};
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.055 + 0.5 * 0.59, servo_current_a(kServo, half_back, -0.067));
}

void test_the_weight_couple_is_that_of_a_point_mass_over_the_tyres_edge() {
  const double mass_kg = 0.2, height_m = 0.063, tyre_m = 0.012, roll_rad = 0.4;
  const double lever_m = height_m * std::tan(roll_rad) - tyre_m / 2;
  const CarriedLoad weight{mass_kg * 9.81 * height_m, 0, mass_kg * 9.81 * tyre_m};
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, mass_kg * 9.81 * lever_m, load_roll_couple_n_m(weight, std::sin(roll_rad)));
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, -mass_kg * 9.81 * lever_m,
                            load_roll_couple_n_m(weight, -std::sin(roll_rad)));
}

void test_a_tyre_leans_on_its_edge_from_a_fiftieth_and_evenly_until_then() {
  const CarriedLoad load{0, 0, 0.012};  // 1 N on a tyre of 12 mm
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.006, load_roll_couple_n_m(load, 0.02));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.003, load_roll_couple_n_m(load, 0.01));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.006, load_roll_couple_n_m(load, -0.5));
}

void test_what_carries_or_weighs_beside_the_middle_rolls_by_its_lever() {
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.03, load_roll_couple_n_m({0, 0.03, 0}, 0.1));  // pushed up on the left
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.2 * 9.81 * 0.01, offset_roll_couple_n_m(0.2 * 0.01));
}

void test_the_angles_of_roll_are_those_of_its_sine_up_to_a_car_that_has_tipped() {
  for (const double roll_rad : {-1.2, -0.3, 0.0, 0.7, 1.2}) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, std::sin(roll_rad), sin_roll_limited(std::sin(roll_rad)));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, std::cos(roll_rad), cos_roll(std::sin(roll_rad)));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, std::tan(roll_rad), tan_roll(std::sin(roll_rad)));
  }
  TEST_ASSERT_EQUAL_DOUBLE(kMaxSinRoll, sin_roll_limited(1.5));
  TEST_ASSERT_EQUAL_DOUBLE(-kMaxSinRoll, sin_roll_limited(-1));
}

namespace {

// Below the middle of a car of 0.25 kg, height 0.06 m, pressed on for one step by 0.6 N at friction 0.5.
GroundContact contact_at(double ahead_m, double tangent_n_s) {
  GroundContact contact;
  contact.ahead_m = ahead_m;
  contact.depth_m = 0.06;
  contact.limit_n_s = 0.5 * 0.6 / 240;
  contact.tangent_n_s = tangent_n_s;
  return contact;
}

constexpr double kStep_s = 1.0 / 240;

PlaneRates level() {
  PlaneRates plane;
  plane.roll_inertia_kg_m2 = 5e-4;
  return plane;
}

LateralDynamics motion() { return LateralDynamics({0.25, 0.06, 5e-4, 1.3e-3}); }

}  // namespace

// In a car whose roll nothing holds, a slide ends as all of it - sideways speed and what friction's couple makes it
// roll - has come to rest at the contacts: the angular momentum about their line stays what the slide had.
void test_a_slide_is_braked_by_friction_and_then_holds() {
  LateralDynamics side = motion();
  std::vector<GroundContact> contacts{contact_at(0.07, 0), contact_at(-0.07, 0)};
  PlaneRates plane = level();
  contacts[0].slope_n_s = 0.25 * 0.3;  // to the left at 0.3 m/s
  contacts[0].ahead_m = contacts[1].ahead_m = 0;
  contacts[0].depth_m = contacts[1].depth_m = 0.06;
  side.step(kStep_s, plane, contacts);
  const double lost_m_s = 2 * contacts[0].limit_n_s / 0.25;
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.3 - lost_m_s, side.lateral_speed_m_s());
  // The push's and friction's couple, for the plane to roll by.
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.06 * (0.25 * 0.3 - 2 * contacts[0].limit_n_s) / kStep_s, side.roll_couple_n_m());
  contacts[0].slope_n_s = 0;
  for (int i = 0; i < 400; ++i) {
    plane.roll_rate_rad_s += side.roll_couple_n_m() * kStep_s / 5e-4;
    side.step(kStep_s, plane, contacts);
  }
  const double centre_m_s = side.lateral_speed_m_s() - 0.06 * plane.roll_rate_rad_s;
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, side.lateral_speed_m_s());
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, 0.06 * 0.25 * centre_m_s - 5e-4 * plane.roll_rate_rad_s);
}

// What the plane takes for roll inertia changes when a couple is felt, not what it comes to.
void test_more_roll_inertia_in_the_plane_is_made_good() {
  LateralDynamics side = motion();
  std::vector<GroundContact> none;
  PlaneRates plane;
  plane.roll_inertia_kg_m2 = 1.1e-3;
  double couple_n_m = 0.002;
  for (int i = 0; i < 200; ++i) {
    plane.roll_rate_rad_s += (couple_n_m + side.roll_couple_n_m()) * kStep_s / 1.1e-3;
    side.step(kStep_s, plane, none);
    couple_n_m = i < 20 ? 0.002 : 0;
  }
  TEST_ASSERT_DOUBLE_WITHIN(1e-6, 21 * 0.002 * kStep_s / 5e-4, plane.roll_rate_rad_s);
}

void test_driving_and_sliding_share_one_friction_circle() {
  LateralDynamics side = motion();
  const double limit_n_s = contact_at(0, 0).limit_n_s;
  std::vector<GroundContact> contacts{contact_at(0.07, limit_n_s), contact_at(-0.07, -limit_n_s)};
  PlaneRates plane = level();
  plane.yaw_rate_rad_s = 3;
  side.step(kStep_s, plane, contacts);
  for (const GroundContact& contact : contacts) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, limit_n_s, std::hypot(contact.lateral_n_s, contact.limited_tangent_n_s));
    TEST_ASSERT_TRUE(std::abs(contact.limited_tangent_n_s) < limit_n_s && contact.lateral_n_s * contact.ahead_m < 0);
  }
}

void test_scrub_brakes_a_turn_by_its_couple() {
  LateralDynamics side = motion();
  std::vector<GroundContact> contacts{contact_at(0.07, 0), contact_at(-0.07, 0)};
  PlaneRates plane = level();
  plane.yaw_rate_rad_s = 3;
  side.step(kStep_s, plane, contacts);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 3 - 2 * 0.07 * contacts[0].limit_n_s / 1.3e-3, side.yaw_rate_rad_s());
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 2 * 0.07 * contacts[0].limit_n_s / kStep_s, side.scrub_n_m());
}

// Angular momentum about the vertical of a body that nothing touches: its forward axis leans by pitch, so roll has a
// part of it.
void test_a_pitched_car_that_starts_to_roll_turns_back() {
  LateralDynamics side = motion();
  std::vector<GroundContact> none;
  PlaneRates plane = level();
  plane.pitch_rad = 0.5;
  plane.roll_rate_rad_s = 3;
  side.step(kStep_s, plane, none);
  const double forward[2] = {std::cos(0.5), std::sin(0.5)}, up[2] = {-std::sin(0.5), std::cos(0.5)};
  // Rates about the body's own axes, then their momenta's vertical part.
  const double about_forward = 3 + side.yaw_rate_rad_s() * forward[1], about_up = side.yaw_rate_rad_s() * up[1];
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, 5e-4 * about_forward * forward[1] + 1.3e-3 * about_up * up[1]);
  TEST_ASSERT_TRUE(side.yaw_rate_rad_s() < -0.1);
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
  RUN_TEST(test_a_tyre_leans_on_its_edge_from_a_fiftieth_and_evenly_until_then);
  RUN_TEST(test_what_carries_or_weighs_beside_the_middle_rolls_by_its_lever);
  RUN_TEST(test_the_angles_of_roll_are_those_of_its_sine_up_to_a_car_that_has_tipped);
  RUN_TEST(test_driving_and_sliding_share_one_friction_circle);
  RUN_TEST(test_a_slide_is_braked_by_friction_and_then_holds);
  RUN_TEST(test_more_roll_inertia_in_the_plane_is_made_good);
  RUN_TEST(test_scrub_brakes_a_turn_by_its_couple);
  RUN_TEST(test_a_pitched_car_that_starts_to_roll_turns_back);
  return UNITY_END();
}
