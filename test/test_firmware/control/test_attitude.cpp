// The attitude from an IMU, against rotations whose angles are known in closed form.
#include "../../suite.h"

#include <cmath>

#include "attitude.h"

using namespace foldcar;

namespace {

constexpr float kG = 9.81f;
constexpr float kStepS = 0.02f;

// What a car at rest measures, with its nose up by pitch and its left side up by roll.
ImuSample at_rest(float roll, float pitch) {
  ImuSample sample;
  sample.acceleration_m_s2 = {kG * std::sin(pitch), kG * std::cos(pitch) * std::sin(roll),
                              kG * std::cos(pitch) * std::cos(roll)};
  return sample;
}

}  // namespace

TEST(a_car_at_rest_shows_its_angles_at_once) {
  for (const float roll : {-2.0f, -0.3f, 0.0f, 0.5f, 3.0f}) {
    for (const float pitch : {-1.2f, 0.0f, 0.4f}) {
      const Attitude attitude = updated(Attitude{}, at_rest(roll, pitch), kStepS);
      TEST_ASSERT_FLOAT_WITHIN(1e-4f, roll, roll_rad(attitude));
      TEST_ASSERT_FLOAT_WITHIN(1e-4f, pitch, pitch_rad(attitude));
      TEST_ASSERT_FLOAT_WITHIN(1e-3f, std::acos(std::cos(pitch) * std::cos(roll)), tilt_rad(attitude));
    }
  }
}

// A roll of 0.5 rad within 0.5 s, with gravity as the accelerometer sees it: the estimate follows without lag.
TEST(a_turn_is_followed_by_the_gyroscope) {
  Attitude attitude = updated(Attitude{}, at_rest(0.0f, 0.0f), kStepS);
  for (int i = 1; i <= 25; ++i) {
    ImuSample sample = at_rest(0.02f * static_cast<float>(i), 0.0f);
    sample.rate_rad_s = {1.0f, 0.0f, 0.0f};
    attitude = updated(attitude, sample, kStepS);
  }
  TEST_ASSERT_FLOAT_WITHIN(0.01f, 0.5f, roll_rad(attitude));
}

// A gyroscope of 500 degrees/s may have a bias of 1 degree/s. In the filter's steady state the error is bias × time constant.
TEST(gravity_holds_the_drift_of_the_gyroscope) {
  constexpr float kDriftRadS = 0.0175f;
  Attitude attitude;
  for (int i = 0; i < 50 * 600; ++i) {
    ImuSample sample = at_rest(0.0f, 0.0f);
    sample.rate_rad_s = {kDriftRadS, -kDriftRadS, 0.0f};
    attitude = updated(attitude, sample, kStepS);
  }
  TEST_ASSERT_FLOAT_WITHIN(0.001f, kDriftRadS * 0.5f, roll_rad(attitude));
  TEST_ASSERT_FLOAT_WITHIN(0.001f, kDriftRadS * 0.5f, pitch_rad(attitude));
}

TEST(a_shock_does_not_tilt_the_estimate) {
  Attitude attitude = updated(Attitude{}, at_rest(0.0f, 0.0f), kStepS);
  ImuSample shock;
  shock.acceleration_m_s2 = {0.0f, 30.0f, 9.81f};
  for (int i = 0; i < 10; ++i) attitude = updated(attitude, shock, kStepS);
  TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.0f, tilt_rad(attitude));
}

TEST(yaw_counts_turns_to_the_left_and_wraps) {
  Attitude attitude = updated(Attitude{}, at_rest(0.0f, 0.0f), kStepS);
  ImuSample sample = at_rest(0.0f, 0.0f);
  sample.rate_rad_s = {0.0f, 0.0f, 1.0f};
  for (int i = 0; i < 100; ++i) attitude = updated(attitude, sample, kStepS);
  TEST_ASSERT_FLOAT_WITHIN(1e-3f, 2.0f, attitude.yaw_rad);
  for (int i = 0; i < 100; ++i) attitude = updated(attitude, sample, kStepS);
  TEST_ASSERT_FLOAT_WITHIN(1e-3f, 4.0f - 2.0f * 3.14159265f, attitude.yaw_rad);
}
