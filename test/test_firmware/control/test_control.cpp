// The controller (wheel speeds, pulses, slew, stagger, mirror symmetry) and the attitude from an IMU, against closed forms.
#include "../../suite.h"

#include <algorithm>
#include <cmath>

#include "attitude.h"
#include "differential_drive.h"

using namespace foldcar;

namespace {

constexpr std::uint32_t kTick = 20000;

// The pulses after 10 s, when every ramp and stagger of the tests has ended.
PulsesUs settled(const Parameters& parameters, const SetPoint& set_point) {
  const Calibration calibration = calibrate(parameters);
  DriveState state;
  PulsesUs pulses_us{};
  for (int i = 0; i < 500; ++i) pulses_us = drive(calibration, state, set_point, kTick);
  return pulses_us;
}

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

// Rolling: the car's speed is the mean of the rims' speeds, its yaw rate, positive to the left, their difference over the
// track. Where that is faster than wheels turn, both sides are scaled back alike, which keeps the curvature.
TEST(wheel_speeds_add_up_to_the_set_point_or_to_its_curvature) {
  const Calibration calibration = calibrate(Parameters());
  for (const float speed_m_s : {0.3f, 1.0f, -3.0f}) {
    for (const float yaw_rate_rad_s : {-20.0f, 0.0f, 1.0f}) {
      const float turn_m_s = 0.5f * 0.111f * yaw_rate_rad_s;
      const float left_rad_s = (speed_m_s - turn_m_s) / 0.06f, right_rad_s = (speed_m_s + turn_m_s) / 0.06f;
      const float scale = std::min(1.0f, 11.5f / std::max(std::fabs(left_rad_s), std::fabs(right_rad_s)));
      const WheelSpeeds speeds = wheel_speeds(calibration, {speed_m_s, yaw_rate_rad_s});
      TEST_ASSERT_FLOAT_WITHIN(1e-4f, scale * left_rad_s, speeds.left_rad_s);
      TEST_ASSERT_FLOAT_WITHIN(1e-4f, scale * right_rad_s, speeds.right_rad_s);
    }
  }
}

TEST(every_wheel_has_its_own_neutral_deadband_direction_and_gain) {
  Parameters parameters;
  parameters.set("WHEEL_RADIUS_M", 0.05f);
  const float neutral_us[] = {1480.0f, 1510.0f, 1523.5f, 1499.0f};
  const float deadband_us[] = {5.0f, 45.0f, 20.0f, 0.0f};
  const float direction[] = {-1.0f, 1.0f, 1.0f, -1.0f};
  const float gain_us[] = {10.0f, 20.0f, 15.0f, 8.0f};
  for (std::size_t channel = 0; channel < 4; ++channel) {
    parameters.set(channel_parameter(channel, ChannelParameter::kNeutralUs), neutral_us[channel]);
    parameters.set(channel_parameter(channel, ChannelParameter::kDeadbandUs), deadband_us[channel]);
    parameters.set(channel_parameter(channel, ChannelParameter::kDirection), direction[channel]);
    parameters.set(channel_parameter(channel, ChannelParameter::kGainUs), gain_us[channel]);
  }
  // 0.2 m/s on wheels of 50 mm is 4 rad/s.
  const PulsesUs forward_us = settled(parameters, {0.2f, 0.0f});
  const PulsesUs backward_us = settled(parameters, {-0.2f, 0.0f});
  const PulsesUs still_us = settled(parameters, {0.0f, 0.0f});
  for (std::size_t channel = 0; channel < 4; ++channel) {
    const float distance_us = direction[channel] * (deadband_us[channel] + 4.0f * gain_us[channel]);
    TEST_ASSERT_FLOAT_WITHIN(0.01f, neutral_us[channel] + distance_us, forward_us[channel]);
    TEST_ASSERT_FLOAT_WITHIN(0.01f, neutral_us[channel] - distance_us, backward_us[channel]);
    TEST_ASSERT_TRUE(still_us[channel] == neutral_us[channel]);
  }
}

// A servo of another kind, or one that was mounted the other way round.
TEST(a_reversed_servo_gets_the_mirrored_pulse) {
  Parameters designed;
  Parameters parameters;
  TEST_ASSERT_TRUE(parameters.set("CH2_REVERSED", 1.0f) == SetResult::kOk);
  const PulsesUs designed_us = settled(designed, {0.2f, 0.0f});
  const PulsesUs pulses_us = settled(parameters, {0.2f, 0.0f});
  TEST_ASSERT_FLOAT_WITHIN(0.01f, 3000.0f - designed_us[1], pulses_us[1]);
  TEST_ASSERT_TRUE(designed_us[1] < 1450.0f);
  for (const std::size_t channel : {0u, 2u, 3u}) TEST_ASSERT_TRUE(pulses_us[channel] == designed_us[channel]);
}

TEST(pulses_stay_within_what_servos_understand) {
  Parameters parameters;
  for (const char* name : {"CH1_GAIN_US", "CH2_GAIN_US"}) parameters.set(name, 500.0f);
  const PulsesUs pulses_us = settled(parameters, {0.69f, 0.0f});
  TEST_ASSERT_TRUE(pulses_us[0] == 2000.0f);
  TEST_ASSERT_TRUE(pulses_us[1] == 1000.0f);
}

// The n-th axle's ramp is slew × (time − n × stagger) for any length of the ticks.
TEST(axles_start_one_after_the_other_and_ramp_at_the_slew_rate) {
  for (const std::uint32_t step_us : {5000u, 20000u, 33333u}) {
    Parameters parameters;
    parameters.set("STAGGER_MS", 70.0f);
    parameters.set("SLEW_US_PER_S", 400.0f);
    const Calibration calibration = calibrate(parameters);
    DriveState state;
    PulsesUs pulses_us = drive(calibration, state, {0.69f, 0.0f}, 0);
    for (std::size_t channel = 0; channel < 4; ++channel) TEST_ASSERT_TRUE(pulses_us[channel] == 1500.0f);
    for (std::uint32_t time_us = step_us; time_us < 600000; time_us += step_us) {
      pulses_us = drive(calibration, state, {0.69f, 0.0f}, step_us);
      for (std::size_t axle = 0; axle < 2; ++axle) {
        const double ramp_us = 400e-6 * (static_cast<double>(time_us) - 70000.0 * static_cast<double>(axle));
        const double expected_us = ramp_us <= 0.0 ? 1500.0 : 1545.0 + std::min(ramp_us, 155.0);
        TEST_ASSERT_FLOAT_WITHIN(0.02f, static_cast<float>(expected_us), pulses_us[2 * axle]);
        TEST_ASSERT_FLOAT_WITHIN(0.02f, static_cast<float>(3000.0 - expected_us), pulses_us[2 * axle + 1]);
      }
    }
  }
}

TEST(the_stagger_counts_only_channels_in_use) {
  Parameters parameters;
  for (const char* name : {"CH1_SIDE", "CH2_SIDE", "CH3_SIDE", "CH4_SIDE"}) parameters.set(name, 0.0f);
  parameters.set("CH3_SIDE", 2.0f);
  parameters.set("CH5_SIDE", 1.0f);
  parameters.set("CH6_SIDE", 2.0f);
  parameters.set("CH8_SIDE", 1.0f);
  parameters.set("STAGGER_MS", 30.0f);
  const Calibration calibration = calibrate(parameters);
  TEST_ASSERT_EQUAL_UINT32(0, calibration.wheels[2].starts_at_us);
  TEST_ASSERT_EQUAL_UINT32(0, calibration.wheels[4].starts_at_us);
  TEST_ASSERT_EQUAL_UINT32(30000, calibration.wheels[5].starts_at_us);
  TEST_ASSERT_EQUAL_UINT32(30000, calibration.wheels[7].starts_at_us);
}

TEST(a_reversal_ramps_through_neutral) {
  Parameters parameters;
  parameters.set("SLEW_US_PER_S", 1000.0f);
  const Calibration calibration = calibrate(parameters);
  DriveState state;
  for (int i = 0; i < 50; ++i) drive(calibration, state, {0.69f, 0.0f}, kTick);
  // From +155 to -155 us beyond the deadband at 20 us a tick.
  for (int i = 1; i <= 20; ++i) {
    const PulsesUs pulses_us = drive(calibration, state, {-0.69f, 0.0f}, kTick);
    const float excess_us = std::max(155.0f - 20.0f * static_cast<float>(i), -155.0f);
    const float expected_us = 1500.0f + excess_us + (excess_us > 0.0f ? 45.0f : -45.0f);
    TEST_ASSERT_FLOAT_WITHIN(0.02f, expected_us, pulses_us[0]);
  }
}

// A mirrored set-point drives the left side exactly as the other drove the right, at every step of the ramp.
TEST(mirrored_set_points_give_mirrored_pulses_to_the_last_bit) {
  const Calibration calibration = calibrate(Parameters());
  DriveState state;
  DriveState mirrored_state;
  for (int i = 0; i < 40; ++i) {
    const std::uint32_t step_us = 19000u + 137u * static_cast<std::uint32_t>(i % 7);
    const PulsesUs pulses_us = drive(calibration, state, {0.37f, 1.7f}, step_us);
    const PulsesUs mirrored_us = drive(calibration, mirrored_state, {0.37f, -1.7f}, step_us);
    for (const std::size_t left : {0u, 2u}) {
      TEST_ASSERT_TRUE(state.excess_us[left] == mirrored_state.excess_us[left + 1]);
      TEST_ASSERT_TRUE(state.excess_us[left + 1] == mirrored_state.excess_us[left]);
      TEST_ASSERT_FLOAT_WITHIN(1e-3f, pulses_us[left] - 1500.0f, 1500.0f - mirrored_us[left + 1]);
    }
  }
}

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

// Without saturation the time since the start would begin again, and the rear axle wait for its turn.
TEST(after_71_minutes_of_driving_every_wheel_still_obeys) {
  const Calibration calibration = calibrate(Parameters());
  DriveState state;
  state.elapsed_us = UINT32_MAX - 10000;
  for (int i = 0; i < 50; ++i) drive(calibration, state, {0.3f, 0.0f}, 20000);
  TEST_ASSERT_TRUE(state.excess_us[2] > 1.0f);
  const float before_us = state.excess_us[2];
  state.elapsed_us = UINT32_MAX - 10000;
  drive(calibration, state, {0.0f, 0.0f}, 20000);
  TEST_ASSERT_TRUE(state.excess_us[2] < before_us);
}
