// Who may drive the car, and when it stops by itself: link loss, manual control, unknown hosts.
#include "../suite.h"

#include <random>

#include "../link_fuzz.h"
#include "link_bench.h"

using namespace foldcar;

// In each of a thousand trials the host falls silent at a random time, between ticks too.
TEST(pulses_are_off_within_half_a_second_of_link_loss_a_thousand_times) {
  std::mt19937_64 random(2);
  std::uniform_int_distribution<std::uint64_t> any_us(0, 3000000);
  for (int trial = 0; trial < 1000; ++trial) {
    Bench bench;
    bench.start(kStart);
    const std::uint64_t lost_us = bench.board.clock.time_us + any_us(random);
    std::uint64_t last_heard_us = bench.board.clock.time_us, off_us = 0;
    const std::uint64_t step_us = 1000 + any_us(random) % 6000;
    for (std::uint64_t next_us = 0; off_us == 0; bench.board.clock.time_us += step_us) {
      const std::uint64_t now_us = bench.board.clock.time_us;
      if (now_us >= next_us && now_us < lost_us) {
        bench.board.link.incoming += bench.host.heartbeat();
        last_heard_us = now_us;
        next_us = now_us + 200000;
      }
      bench.firmware.poll();
      if (bench.last_us() == kOff) off_us = now_us;
      TEST_ASSERT_TRUE(now_us < lost_us + 2000000);
    }
    TEST_ASSERT_TRUE(bench.fault() == Fault::kCommandStale);
    TEST_ASSERT_TRUE(off_us > last_heard_us + 400000);
    TEST_ASSERT_TRUE(off_us <= last_heard_us + 500000);
  }
}

TEST(only_the_host_that_drives_keeps_a_trial_alive) {
  Bench bench;
  MavlinkHost other(200);
  bench.start(kStart);
  for (int i = 0; i < 5; ++i) bench.run(100, other.heartbeat());
  TEST_ASSERT_TRUE(bench.fault() == Fault::kCommandStale);
  TEST_ASSERT_EQUAL_STRING("fault: no command from the host", bench.last_text().c_str());
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kFaultLatched, MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, {});
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
}

TEST(the_stick_drives_and_its_silence_stops) {
  Bench bench;
  bench.run(100, bench.host.stick(500));
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.run(100, bench.host.stick(500));
  TEST_ASSERT_TRUE(bench.state() == State::kManual);
  for (int i = 0; i < 10; ++i) bench.run(100, bench.host.stick(500));
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1500.0f + 45.0f + 77.5f, bench.last_us()[0]);
  for (int i = 0; i < 10; ++i) bench.run(100, bench.host.stick(INT16_MAX));  // "axis is invalid"
  TEST_ASSERT_EQUAL_FLOAT(1500.0f, bench.last_us()[0]);
  bench.run(500);
  TEST_ASSERT_TRUE(bench.state() == State::kFault);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
}

TEST(a_single_packet_sets_nothing_in_motion) {
  Bench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.run(2100);
  bench.run(40, bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, kStart));
  TEST_ASSERT_TRUE(bench.last_refusal() == Refusal::kUnknownHost);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  bench.run(2100);
  bench.run(40, bench.host.stick(500));
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {0});
  bench.run(2100);
  bench.run(40, bench.host.command(MAV_CMD_ACTUATOR_TEST, {0, 1, 0, 0, ACTUATOR_OUTPUT_FUNCTION_SERVO1}));
  TEST_ASSERT_TRUE(bench.last_refusal() == Refusal::kUnknownHost);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
}

// `make fuzz` looks for such bytes by coverage, under sanitizers.
TEST(a_million_random_and_damaged_bytes_move_nothing) {
  LinkFuzz fuzz(1);
  TEST_ASSERT_TRUE(fuzz.run(1000000));
  TEST_ASSERT_TRUE(fuzz.fed() >= 1000000);
}
