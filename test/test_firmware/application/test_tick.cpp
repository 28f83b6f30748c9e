// The recording HAL keeps the contract. The tick: pulses in each state, the ramp over ticks early and late, the stick,
// parameters, many cars in one process.
#include "../../suite.h"

#include <array>
#include <cmath>
#include <vector>

#include "../../hal_contract.h"
#include "application_bench.h"

using namespace foldcar;

TEST(the_recording_hal_keeps_the_contract) {
  for (const bool with_imu : {false, true}) {
    RecordingHal board;
    board.imu.fitted = with_imu;
    check_hal_contract(board.hal(), [&board] { board.clock.time_us += 10; });
  }
}

TEST(pulses_come_only_while_a_trial_runs) {
  ApplicationBench bench;
  Application& car = bench.application;
  const auto pulses_after_tick = [&bench] {
    bench.tick();
    return any_pulse(bench.last_us());
  };
  car.begin();
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "disarmed");
  car.arm();
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "armed");
  car.start(kTrial);
  TEST_ASSERT_TRUE_MESSAGE(pulses_after_tick(), "running");
  car.stop();
  TEST_ASSERT_FALSE_MESSAGE(any_pulse(bench.last_us()), "stop acts at once");
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "finished");
  car.arm();
  car.start(kTrial);
  TEST_ASSERT_TRUE_MESSAGE(pulses_after_tick(), "running again");
  bench.board.battery.volts = NAN;
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "fault");
  bench.board.battery.volts = 4.0f;
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "the fault is latched");
  car.acknowledge();
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "acknowledged");
  car.arm();
  car.start(kTrial);
  car.disarm();
  TEST_ASSERT_FALSE_MESSAGE(any_pulse(bench.last_us()), "disarm acts at once");
}

TEST(the_first_tick_of_a_trial_is_neutral_and_the_ramp_follows_the_clock) {
  ApplicationBench bench;
  bench.parameters.set("SLEW_US_PER_S", 500.0f);
  bench.parameters.set("STAGGER_MS", 0.0f);
  bench.run();
  bench.tick(0);
  TEST_ASSERT_TRUE(bench.last_us()[0] == 1500.0f);
  // Ticks that come early and late; 0.5 us of pulse a millisecond beyond the deadband of 45 us.
  float elapsed_ms = 0.0f;
  for (const float step_ms : {20.0f, 13.0f, 31.0f, 20.0f, 1.0f}) {
    bench.tick(static_cast<std::uint64_t>(1000.0f * step_ms));
    elapsed_ms += step_ms;
    TEST_ASSERT_FLOAT_WITHIN(0.01f, 1545.0f + 0.5f * elapsed_ms, bench.last_us()[0]);
  }
  bench.tick(150000);
  TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.01f, 1545.0f + 0.5f * (elapsed_ms + 100.0f), bench.last_us()[0], "a gap is 0.1 s");
  bench.tick(6000000);
  TEST_ASSERT_TRUE_MESSAGE(bench.state() == State::kFinished, "nor does it lengthen the trial");
}

TEST(a_second_trial_starts_from_rest_like_the_first) {
  ApplicationBench bench;
  bench.run();
  std::vector<PulsesUs> first_us;
  for (int i = 0; i < 20; ++i) {
    bench.tick();
    first_us.push_back(bench.last_us());
  }
  bench.application.stop();
  bench.tick(700000);
  bench.application.arm();
  bench.application.start(kTrial);
  for (const PulsesUs& pulses_us : first_us) {
    bench.tick();
    TEST_ASSERT_TRUE(bench.last_us() == pulses_us);
  }
}

TEST(parameters_changed_in_a_trial_drive_the_next_one) {
  ApplicationBench bench;
  bench.run();
  bench.run_ticks(50);
  bench.parameters.set("CH1_NEUTRAL_US", 1450.0f);
  bench.tick();
  TEST_ASSERT_FLOAT_WITHIN(0.01f, 1700.0f, bench.last_us()[0]);
  bench.application.stop();
  bench.application.arm();
  bench.application.start(kTrial);
  bench.run_ticks(50);
  TEST_ASSERT_FLOAT_WITHIN(0.01f, 1650.0f, bench.last_us()[0]);
}

// Full stick is WHEEL_MAX_RAD_S: 45 + 155 us from neutral at the default gain, mirrored on the right.
TEST(the_stick_drives_and_turns_an_armed_car) {
  ApplicationBench bench;
  Application& car = bench.application;
  car.begin();
  TEST_ASSERT_TRUE(car.drive_manually(1.0f, 0.0f) == Refusal::kNotArmed);
  car.arm();
  for (const float left : {0.0f, 1.0f}) {
    for (int i = 0; i < 50; ++i) {
      car.drive_manually(1.0f - left, left);
      bench.tick();
    }
    TEST_ASSERT_FLOAT_WITHIN(0.1f, left > 0.0f ? 1300.0f : 1700.0f, bench.last_us()[0]);
    TEST_ASSERT_FLOAT_WITHIN(0.1f, 1300.0f, bench.last_us()[1]);
  }
  for (const float wrong : {NAN, 1.1f}) TEST_ASSERT_TRUE(car.drive_manually(wrong, 0.0f) == Refusal::kNotANumber);
}

TEST(a_parameter_that_is_set_is_saved_and_forgotten_on_request) {
  ApplicationBench bench;
  Application& car = bench.application;
  car.begin();
  TEST_ASSERT_TRUE(car.set_parameter(Parameter::kTrackM, 0.2f) == SetResult::kOk);
  TEST_ASSERT_TRUE(car.unsaved_parameter() == Parameter::kTrackM);
  TEST_ASSERT_TRUE(car.save_parameter(Parameter::kTrackM));
  TEST_ASSERT_EQUAL_FLOAT(0.2f, bench.board.storage.values["TRACK_M"]);
  TEST_ASSERT_TRUE(car.set_parameter(Parameter::kTrackM, -1.0f) == SetResult::kBelowMinimum);
  TEST_ASSERT_FALSE(car.unsaved_parameter().has_value());
  TEST_ASSERT_TRUE(car.set_parameter(Parameter::kTrackM, 0.3f) == SetResult::kOk);
  TEST_ASSERT_TRUE(car.reset_parameters());
  TEST_ASSERT_FALSE_MESSAGE(car.unsaved_parameter().has_value(), "would be saved after the reset");
  TEST_ASSERT_TRUE(bench.board.storage.values.empty());
  TEST_ASSERT_EQUAL_FLOAT(0.111f, bench.parameters.get(Parameter::kTrackM));
}

// Cars that are ticked in turn write exactly the pulses that each writes alone.
TEST(many_applications_do_not_influence_each_other) {
  const auto start = [](ApplicationBench& bench, float number) {
    bench.parameters.set("TRACK_M", 0.08f + 0.005f * number);
    bench.run({0.1f + 0.01f * number, 0.2f * number - 4.0f, 0.5f + 0.02f * number, true, 0});
  };
  std::array<ApplicationBench, 20> together;
  for (std::size_t i = 0; i < together.size(); ++i) start(together[i], static_cast<float>(i));
  for (int tick = 0; tick < 60; ++tick) {
    for (ApplicationBench& bench : together) bench.tick();
  }
  for (std::size_t i = 0; i < together.size(); ++i) {
    ApplicationBench alone;
    start(alone, static_cast<float>(i));
    alone.run_ticks(60);
    TEST_ASSERT_TRUE(alone.board.servos.writes == together[i].board.servos.writes);
  }
}
