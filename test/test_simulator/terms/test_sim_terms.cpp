// The terms of the model on their own: the servo line, contact impulses and their friction cone.
#include "../../suite.h"

#include <cmath>
#include <numeric>
#include <vector>

#include "../../study_car.h"
#include "car_dynamics.h"
#include "contact_solver.h"
#include "servo_model.h"

using namespace foldcar;

namespace {

const ServoSpec kServo = {0.134, 11.5, 5.2, 0.7, 0.11, 2e-4, 1500, 45, 200, 1};
constexpr double kStep_s = 1.0 / 240;

double torque_n_m(double pulse_us, double omega_rad_s, double supply_v = 5.2) {
  return servo_torque_n_m(kServo, servo_drive(kServo, pulse_us), omega_rad_s, supply_v);
}

// The study car, level, pressed onto four points below its axles by a step's gravity, with these velocities.
struct Pressed {
  BodySpec body = study_car(0.115);
  CarDynamics car{body, kStep_s};
  std::vector<Contact> contacts;
  Pressed(double friction, const Vec3& velocity_m_s, double yaw_rad_s) {
    for (std::size_t i = 0; i < body.wheels.size(); ++i) {
      Contact contact;
      contact.wheel = static_cast<int>(i);
      contact.point_m = car.axle(i) - Vec3{0, 0, body.wheels[i].radius_m};
      contact.normal = {0, 0, 1};
      contact.along = {1, 0, 0};
      contact.friction = friction;
      contacts.push_back(contact);
    }
    car.velocity = {velocity_m_s.x, velocity_m_s.y, velocity_m_s.z, 0, 0, yaw_rad_s};
    car.velocity.resize(car.size());
    car.accelerate(std::vector<double>(4), std::vector<double>(4));
    make_contact_solver(body, kStep_s, 200)->solve(car, contacts);
  }
  Vec3 slip_m_s(const Contact& contact) const {
    double row[kMaxRowLength];
    const auto along = [&](const Vec3& direction) {
      car.jacobian(contact.point_m, direction, contact.segment, contact.wheel, row);
      return std::inner_product(car.velocity.begin(), car.velocity.end(), row, 0.0);
    };
    return {along({1, 0, 0}), along({0, 1, 0}), along({0, 0, 1})};
  }
};

}  // namespace

TEST(test_speed_grows_linearly_beyond_the_deadband_and_saturates) {
  for (const double pulse_us : {1456.0, 1500.0, 1544.0}) {
    TEST_ASSERT_TRUE(servo_drive(kServo, pulse_us).powered);
    TEST_ASSERT_EQUAL_DOUBLE(0, servo_drive(kServo, pulse_us).fraction);
  }
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5, servo_drive(kServo, 1500 + 45 + 77.5).fraction);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.5, servo_drive(kServo, 1500 - 45 - 77.5).fraction);
  TEST_ASSERT_EQUAL_DOUBLE(1, servo_drive(kServo, 1700).fraction);
  TEST_ASSERT_EQUAL_DOUBLE(1, servo_drive(kServo, 2000).fraction);
  TEST_ASSERT_EQUAL_DOUBLE(-1, servo_drive(kServo, 1000).fraction);
  ServoSpec mirrored = kServo;
  mirrored.direction = -1;
  TEST_ASSERT_EQUAL_DOUBLE(-1, servo_drive(mirrored, 1700).fraction);
}

TEST(test_torque_is_a_line_from_stall_to_no_load) {
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.134, torque_n_m(1700, 0));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.067, torque_n_m(1700, 5.75));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, torque_n_m(1700, 11.5));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.134, torque_n_m(1300, 0));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.067, torque_n_m(1500, 5.75));  // neutral brakes
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.134, torque_n_m(1300, 11.5));  // never more than stall torque
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.134 * 0.8, torque_n_m(1700, 0, 0.8 * 5.2));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, torque_n_m(1700, 0.8 * 11.5, 0.8 * 5.2));
}

TEST(test_current_runs_from_free_to_stall_and_without_pulses_there_is_none) {
  const ServoDrive off = servo_drive(kServo, kNoPulse);
  TEST_ASSERT_FALSE(off.powered);
  TEST_ASSERT_EQUAL_DOUBLE(0, servo_torque_n_m(kServo, off, 5, 5.2));
  TEST_ASSERT_EQUAL_DOUBLE(0, servo_current_a(kServo, off, 0));
  const ServoDrive full = servo_drive(kServo, 1700);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.11, servo_current_a(kServo, full, 0));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.70, servo_current_a(kServo, full, 0.134));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.70, servo_current_a(kServo, full, -0.134));  // braking draws as much
  const ServoDrive half_back{true, -0.5};
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.055 + 0.5 * 0.59, servo_current_a(kServo, half_back, -0.067));
}

// Impulses are within the friction cone, on it where a contact slides, and there against its slip.
TEST(test_friction_lies_in_its_cone_and_opposes_slip) {
  const Pressed pressed(0.5, {0.4, 0.3, 0}, 3);
  double normal_n_s = 0;
  for (const Contact& contact : pressed.contacts) {
    const double* impulse = contact.impulse_n_s;
    const Vec3 slip = pressed.slip_m_s(contact);
    const double size = std::hypot(impulse[1], impulse[2]), speed = std::hypot(slip.x, slip.y);
    normal_n_s += impulse[0];
    TEST_ASSERT_TRUE(impulse[0] >= 0 && size <= 0.5 * impulse[0] + 1e-12 && speed > 0.05);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 * impulse[0], size);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, -slip.x / speed, impulse[1] / size);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, -slip.y / speed, impulse[2] / size);
  }
  const double weight_n_s = (0.165 + 0.175 * 0.115 + 4 * 0.012) * kGravity_m_s2 * kStep_s;
  TEST_ASSERT_DOUBLE_WITHIN(0.03 * weight_n_s, weight_n_s, normal_n_s);
}

TEST(test_friction_that_suffices_holds_every_contact) {
  const double speed_m_s = 0.01, yaw_rad_s = 0.1;
  const Pressed pressed(2, {speed_m_s, speed_m_s, 0}, yaw_rad_s);
  for (const Contact& contact : pressed.contacts) {
    const Vec3 slip = pressed.slip_m_s(contact);
    // Of the speed of the points, lever times yaw included, the contacts' compliance leaves at most a seventh: what
    // stops a wheel along its way turns the light wheel, not the car.
    const double before_m_s = speed_m_s + yaw_rad_s * std::hypot(contact.point_m.x, contact.point_m.y);
    TEST_ASSERT_DOUBLE_WITHIN(before_m_s / 7, 0, slip.x);
    TEST_ASSERT_DOUBLE_WITHIN(before_m_s / 7, 0, slip.y);
  }
}
