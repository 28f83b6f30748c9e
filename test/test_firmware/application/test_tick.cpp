// The recording HAL keeps the contract. The tick in a trial: pulses in each state, the ramp over ticks early and late,
// many cars in one process.
#include "../../suite.h"

#include <cmath>
#include <memory>
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

TEST(after_a_long_gap_the_ramp_does_not_jump) {
  ApplicationBench bench;
  bench.parameters.set("SLEW_US_PER_S", 500.0f);
  bench.parameters.set("STAGGER_MS", 0.0f);
  bench.run();
  bench.tick(2000000);
  TEST_ASSERT_FLOAT_WITHIN(0.01f, 1545.0f + 500.0f * 0.1f, bench.last_us()[0]);
}

TEST(a_late_tick_does_not_lengthen_the_trial) {
  ApplicationBench bench;
  bench.run({0.1f, 0.0f, 1.0f, true, 0});
  bench.tick(1500000);
  TEST_ASSERT_TRUE(bench.state() == State::kFinished);
  TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
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

TEST(status_tells_the_state_the_time_and_the_pulses) {
  ApplicationBench bench;
  bench.run();
  bench.run_ticks(10);
  const Status status = bench.application.status();
  TEST_ASSERT_TRUE(status.state == State::kRunning);
  TEST_ASSERT_EQUAL_UINT64(200000, status.trial_elapsed_us);
  TEST_ASSERT_EQUAL_FLOAT(4.0f, status.battery_v);
  TEST_ASSERT_TRUE(status.pulses_us == bench.last_us());
}

// Cars that are ticked in turn write exactly the pulses that each writes alone.
TEST(many_applications_do_not_influence_each_other) {
  constexpr std::size_t kCarCount = 40;
  const auto make = [](std::size_t number) {
    auto bench = std::make_unique<ApplicationBench>();
    const float n = static_cast<float>(number);
    bench->parameters.set("TRACK_M", 0.08f + 0.005f * n);
    bench->parameters.set("STAGGER_MS", 3.0f * n);
    bench->run({0.1f + 0.01f * n, 0.2f * n - 4.0f, 0.5f + 0.02f * n, true, 0});
    return bench;
  };
  std::vector<std::unique_ptr<ApplicationBench>> together;
  for (std::size_t number = 0; number < kCarCount; ++number) together.push_back(make(number));
  for (int i = 0; i < 60; ++i) {
    for (auto& bench : together) bench->tick();
  }
  for (std::size_t number = 0; number < kCarCount; ++number) {
    const auto alone = make(number);
    for (int i = 0; i < 60; ++i) alone->tick();
    TEST_ASSERT_TRUE(alone->board.servos.writes == together[number]->board.servos.writes);
    TEST_ASSERT_EQUAL_UINT(1 + 60, alone->board.servos.writes.size());  // begin and the ticks
  }
}
