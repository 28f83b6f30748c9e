// Driving without a cable: the delayed start, the button, what the LED shows meanwhile, the servos' battery.
#include "../../suite.h"

#include <string>

#include "led.h"
#include "link_bench.h"

using namespace foldcar;

// What the LED shows in two seconds, a character for 100 ms.
static std::string pattern(State state, LogState log = LogState::kNone) {
  std::string shown;
  for (std::uint64_t step = 0; step < 20; ++step) shown += led_is_on(state, log, 100000 * step + 50000) ? '#' : '.';
  return shown;
}

// docs/firmware.md has this table too.
TEST(each_state_that_a_person_must_know_has_its_pattern) {
  TEST_ASSERT_EQUAL_STRING("....................", pattern(State::kDisarmed).c_str());
  TEST_ASSERT_EQUAL_STRING("#####.....#####.....", pattern(State::kArmed).c_str());
  TEST_ASSERT_EQUAL_STRING("#.#.#.#.#.#.#.#.#.#.", pattern(State::kCounting).c_str());
  for (const State drives : {State::kRunning, State::kManual, State::kTesting}) {
    TEST_ASSERT_EQUAL_STRING("####################", pattern(drives).c_str());
  }
  TEST_ASSERT_EQUAL_STRING("#.#.#.......#.#.#...", pattern(State::kFault, LogState::kOpen).c_str());
  for (const LogState lacks : {LogState::kOpen, LogState::kIncomplete}) {
    TEST_ASSERT_EQUAL_STRING("#.#.........#.#.....", pattern(State::kFinished, lacks).c_str());
  }
  TEST_ASSERT_EQUAL_STRING("....................", pattern(State::kFinished, LogState::kStored).c_str());
}

TEST(an_untethered_trial_counts_without_a_host_and_logs_from_its_first_pulse) {
  LinkBench bench;
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.start({0.3f, 0, 2, 1, 7, 3}).result);
  bench.run(400);
  const mavlink_foldcar_trial_t counting = bench.host.trials().back();
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_STATE_COUNTING, counting.state);
  TEST_ASSERT_UINT32_WITHIN(120, 2600, counting.countdown_ms);
  TEST_ASSERT_EQUAL_UINT32(7, counting.trial_id);
  TEST_ASSERT_EQUAL_UINT32(0, counting.elapsed_ms);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_NONE, counting.log);
  bench.run(2500);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  bench.run(200);
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
  TEST_ASSERT_TRUE(bench.last_us() != kOff);
  TEST_ASSERT_TRUE(bench.board.board.led_is_on);
  bench.run(2200);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, bench.host.trials().back().end);
  TEST_ASSERT_UINT32_WITHIN(40, 2000, bench.host.trials().back().elapsed_ms);
  MavlinkHost reader;
  TEST_ASSERT_TRUE(reader.receive_log(bench.board.logs.logs[1]));
  TEST_ASSERT_UINT_WITHIN(1, 10, count_of(reader, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW));
}

// Saving a parameter could delay the first pulses.
TEST(a_tethered_count_needs_its_host_and_nothing_is_set_meanwhile) {
  LinkBench bench;
  bench.start({0.3f, 0, 2, 0, 7, 3});
  bench.run(20, bench.host.set_parameter("TRACK_M", 0.2f));
  TEST_ASSERT_EQUAL_STRING("TRACK_M is not set: wheels are driven", bench.last_text().c_str());
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kRunning, MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  bench.run(500);
  TEST_ASSERT_TRUE(bench.fault() == Fault::kCommandStale);
}

TEST(the_button_starts_and_stops_a_trial) {
  LinkBench bench;
  bench.expect(MAV_RESULT_DENIED, Refusal::kNotANumber, MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 20, 2, 7, 1});
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  const std::vector<float> by_button = {0.3f, 0, 20, 3, 7, 1};
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kNoButton, MAV_CMD_FOLDCAR_START_TRIAL, by_button);
  bench.run(20, bench.host.set_parameter("BUTTON_WIRED", 1.0f));
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_FOLDCAR_START_TRIAL, by_button);
  bench.run(10000);  // without a host
  TEST_ASSERT_TRUE(bench.state() == State::kArmed);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_TRIAL_FLAGS_UNTETHERED | FOLDCAR_TRIAL_FLAGS_BUTTON, bench.host.trials().back().flags);
  bench.board.board.button = true;
  bench.run(20);
  bench.board.board.button = false;
  bench.run(100);
  TEST_ASSERT_TRUE_MESSAGE(bench.state() == State::kArmed, "shorter than two ticks: a contact bounces");
  bench.board.board.button = true;
  bench.run(900);
  TEST_ASSERT_TRUE_MESSAGE(bench.state() == State::kCounting, "it acts once, however long it is pressed");
  bench.run(200);
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
  bench.board.board.button = false;
  bench.run(1000);
  TEST_ASSERT_TRUE(bench.last_us() != kOff);
  bench.board.board.button = true;
  bench.run(60);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  TEST_ASSERT_TRUE(bench.firmware.application().trial_end() == TrialEnd::kStopped);
}

TEST(the_servos_battery_is_in_telemetry_and_log_where_it_is_measured) {
  for (const float volts : {NAN, 4.93f}) {
    LinkBench bench;
    bench.board.servo_battery.volts = volts;
    bench.start({0.3f, 0, 2, 1, 7});
    bench.run(3000);
    const auto decode = [](const MavlinkHost& host) {
      return host.all<mavlink_battery_status_t>(MAVLINK_MSG_ID_BATTERY_STATUS, mavlink_msg_battery_status_decode);
    };
    MavlinkHost reader;
    TEST_ASSERT_TRUE(reader.receive_log(bench.board.logs.logs[1]));
    const bool is_measured = volts > 0.0f;
    TEST_ASSERT_UINT_WITHIN(1, is_measured ? 6 : 0, decode(bench.host).size());
    TEST_ASSERT_UINT_WITHIN(1, is_measured ? 10 : 0, decode(reader).size());
    if (!is_measured) {
      bench.expect(MAV_RESULT_DENIED, Refusal::kMessage, MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_BATTERY_STATUS});
      continue;
    }
    TEST_ASSERT_EQUAL_UINT16(4930, decode(reader).back().voltages[0]);
    TEST_ASSERT_EQUAL_UINT16(UINT16_MAX, decode(reader).back().voltages[1]);
    TEST_ASSERT_EQUAL_UINT8(FOLDCAR_BATTERY_SERVOS, decode(reader).back().id);
    TEST_ASSERT_EQUAL_INT8(-1, decode(reader).back().battery_remaining);
  }
}
