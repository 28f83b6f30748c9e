// The simulated IMU against motions whose accelerations and turn rates are known in closed form.
#include "../../suite.h"

#include <cmath>
#include <functional>

#include "attitude.h"
#include "motion_sensor.h"

using namespace foldcar;

namespace {

constexpr double kStepS = 1.0 / 240;
constexpr float kG = 9.81f;

// What the sensor shows after two seconds of that motion.
ImuSample after(const std::function<CarState(double)>& motion) {
  MotionSensor sensor;
  ImuSample sample;
  for (int step = 0; step <= 480; ++step) sample = sensor.observe(motion(step * kStepS), kStepS);
  return sample;
}

void expect(const ImuSample& sample, std::array<float, 3> acceleration, std::array<float, 3> rate) {
  for (std::size_t i = 0; i < 3; ++i) {
    TEST_ASSERT_FLOAT_WITHIN(0.02f, acceleration[i], sample.acceleration_m_s2[i]);
    TEST_ASSERT_FLOAT_WITHIN(0.005f, rate[i], sample.rate_rad_s[i]);
  }
}

}  // namespace

TEST(a_car_on_a_circle_is_pushed_inward) {
  constexpr double kRadiusM = 0.5, kRateRadS = 2;
  const ImuSample sample = after([](double t_s) {
    CarState car;
    car.heading_rad = kRateRadS * t_s;
    car.x_m = kRadiusM * std::sin(car.heading_rad);
    car.y_m = kRadiusM * (1 - std::cos(car.heading_rad));
    return car;
  });
  expect(sample, {0.0f, static_cast<float>(kRadiusM * kRateRadS * kRateRadS), kG}, {0.0f, 0.0f, 2.0f});
}

TEST(a_car_that_speeds_up_is_pushed_forward) {
  const ImuSample sample = after([](double t_s) {
    CarState car;
    car.heading_rad = -1.0;
    const double way_m = 0.5 * 1.5 * t_s * t_s;
    car.x_m = way_m * std::cos(car.heading_rad);
    car.y_m = way_m * std::sin(car.heading_rad);
    return car;
  });
  expect(sample, {1.5f, 0.0f, kG}, {0.0f, 0.0f, 0.0f});
}

// Turning by the vertical while the nose is up: the gyroscope sees it about the car's own axes.
TEST(a_tilted_car_that_turns_shows_it_about_its_own_axes) {
  constexpr double kPitch = 0.6;
  const ImuSample sample = after([](double t_s) {
    CarState car;
    car.heading_rad = t_s;
    car.pitch_rad = kPitch;
    return car;
  });
  const float s = std::sin(0.6f), c = std::cos(0.6f);
  expect(sample, {kG * s, 0.0f, kG * c}, {s, 0.0f, c});
}

TEST(the_attitude_follows_the_simulated_sensor) {
  MotionSensor sensor;
  Attitude attitude;
  ImuSample sample;
  for (int step = 0; step <= 2400; ++step) {
    CarState car;
    const double t_s = step * kStepS;
    car.roll_rad = 0.3 * std::sin(1.7 * t_s);
    car.pitch_rad = 0.2 * std::sin(1.1 * t_s);
    car.heading_rad = 0.5 * t_s;
    sample = sensor.observe(car, kStepS);
    if (step % 5 != 0) continue;
    attitude = updated(attitude, sample, 5 * static_cast<float>(kStepS));
    TEST_ASSERT_FLOAT_WITHIN(0.03f, static_cast<float>(car.roll_rad), roll_rad(attitude));
    TEST_ASSERT_FLOAT_WITHIN(0.03f, static_cast<float>(car.pitch_rad), pitch_rad(attitude));
  }
}
