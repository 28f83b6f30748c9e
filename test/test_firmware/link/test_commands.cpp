// Commands and their acknowledgements: arming, trials, output tests, restart.
#include "../../suite.h"

#include <cmath>
#include <initializer_list>
#include <utility>

#include "link_bench.h"

using namespace foldcar;

TEST(a_trial_goes_from_arming_to_its_end_by_commands) {
  LinkBench bench;
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kNotArmed, MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  TEST_ASSERT_EQUAL_STRING("refused: not armed", bench.last_text().c_str());
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_COMPONENT_ARM_DISARM, {1});
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  bench.expect(MAV_RESULT_DENIED, Refusal::kSpeedLimit, MAV_CMD_FOLDCAR_START_TRIAL, {6, 0, 1});
  bench.expect(MAV_RESULT_DENIED, Refusal::kNotANumber, MAV_CMD_FOLDCAR_START_TRIAL, {0.1f, 0, 1, 2});
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0.5f, 2, 0, 7});
  for (int i = 0; i < 9; ++i) bench.run(200, bench.host.heartbeat());
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
  TEST_ASSERT_TRUE(bench.last_us() != kOff);
  bench.run(400, bench.host.heartbeat());
  TEST_ASSERT_TRUE(bench.state() == State::kFinished);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  const mavlink_foldcar_trial_t trial = bench.host.trials().back();
  TEST_ASSERT_EQUAL_UINT32(7, trial.trial_id);
  TEST_ASSERT_UINT32_WITHIN(20, 2000, trial.elapsed_ms);
  TEST_ASSERT_EQUAL_UINT32(2000, trial.time_limit_ms);
  TEST_ASSERT_EQUAL_FLOAT(0.3f, trial.speed);
  TEST_ASSERT_EQUAL_FLOAT(0.5f, trial.yaw_rate);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_STATE_FINISHED, trial.state);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, trial.end);
}

template <typename Dialect, typename Firmware>
static void expect_same(std::initializer_list<std::pair<Dialect, Firmware>> values) {
  for (const auto& [dialect, firmware] : values) TEST_ASSERT_EQUAL_INT(dialect, static_cast<int>(firmware));
}

TEST(every_enum_of_the_firmware_has_the_dialects_values) {
  expect_same<FOLDCAR_STATE, State>({
      {FOLDCAR_STATE_DISARMED, State::kDisarmed}, {FOLDCAR_STATE_ARMED, State::kArmed},
      {FOLDCAR_STATE_RUNNING, State::kRunning}, {FOLDCAR_STATE_FINISHED, State::kFinished},
      {FOLDCAR_STATE_FAULT, State::kFault}, {FOLDCAR_STATE_MANUAL, State::kManual},
      {FOLDCAR_STATE_TESTING, State::kTesting}, {FOLDCAR_STATE_COUNTING, State::kCounting}});
  expect_same<FOLDCAR_FAULT, Fault>({
      {FOLDCAR_FAULT_BUS, Fault::kBus}, {FOLDCAR_FAULT_BATTERY_UNREADABLE, Fault::kBatteryUnreadable},
      {FOLDCAR_FAULT_BATTERY_LOW, Fault::kBatteryLow}, {FOLDCAR_FAULT_COMMAND_STALE, Fault::kCommandStale},
      {FOLDCAR_FAULT_STORED_PARAMETER, Fault::kStoredParameter}, {FOLDCAR_FAULT_DESIGN, Fault::kDesign},
      {FOLDCAR_FAULT_WATCHDOG, Fault::kWatchdog}, {FOLDCAR_FAULT_BROWN_OUT, Fault::kBrownOut},
      {FOLDCAR_FAULT_TILT, Fault::kTilt}, {FOLDCAR_FAULT_IMU, Fault::kImu},
      {FOLDCAR_FAULT_NO_DESIGN, Fault::kNoDesign}, {FOLDCAR_FAULT_FLASH, Fault::kFlash},
      {FOLDCAR_FAULT_INTERRUPT_WATCHDOG, Fault::kInterruptWatchdog}, {FOLDCAR_FAULT_CRASH, Fault::kCrash},
      {FOLDCAR_FAULT_SERVO_BATTERY_LOW, Fault::kServoBatteryLow}});
  expect_same<FOLDCAR_END, TrialEnd>({
      {FOLDCAR_END_TIME_LIMIT, TrialEnd::kTimeLimit}, {FOLDCAR_END_STOPPED, TrialEnd::kStopped},
      {FOLDCAR_END_DISARMED, TrialEnd::kDisarmed}, {FOLDCAR_END_FAULT, TrialEnd::kFault}});
  expect_same<FOLDCAR_DESIGN_SOURCE, DesignSource>({
      {FOLDCAR_DESIGN_SOURCE_FILE, DesignSource::kFile}, {FOLDCAR_DESIGN_SOURCE_REFUSED, DesignSource::kRefused},
      {FOLDCAR_DESIGN_SOURCE_MISSING, DesignSource::kMissing},
      {FOLDCAR_DESIGN_SOURCE_UNREADABLE, DesignSource::kUnreadable}});
  expect_same<FOLDCAR_REFUSAL, Refusal>({
      {FOLDCAR_REFUSAL_NONE, Refusal::kNone}, {FOLDCAR_REFUSAL_NOT_ARMED, Refusal::kNotArmed},
      {FOLDCAR_REFUSAL_RUNNING, Refusal::kRunning}, {FOLDCAR_REFUSAL_NOT_RUNNING, Refusal::kNotRunning},
      {FOLDCAR_REFUSAL_FAULT_LATCHED, Refusal::kFaultLatched}, {FOLDCAR_REFUSAL_NO_FAULT, Refusal::kNoFault},
      {FOLDCAR_REFUSAL_BATTERY_UNREADABLE, Refusal::kBatteryUnreadable}, {FOLDCAR_REFUSAL_BATTERY_LOW, Refusal::kBatteryLow},
      {FOLDCAR_REFUSAL_NO_WHEELS, Refusal::kNoWheels}, {FOLDCAR_REFUSAL_NOT_A_NUMBER, Refusal::kNotANumber},
      {FOLDCAR_REFUSAL_SPEED_LIMIT, Refusal::kSpeedLimit}, {FOLDCAR_REFUSAL_YAW_RATE_LIMIT, Refusal::kYawRateLimit},
      {FOLDCAR_REFUSAL_TIME_LIMIT, Refusal::kTimeLimit}, {FOLDCAR_REFUSAL_DESIGN, Refusal::kDesign},
      {FOLDCAR_REFUSAL_TEST, Refusal::kTest}, {FOLDCAR_REFUSAL_MESSAGE, Refusal::kMessage},
      {FOLDCAR_REFUSAL_NOT_DISARMED, Refusal::kNotDisarmed}, {FOLDCAR_REFUSAL_UNKNOWN_HOST, Refusal::kUnknownHost},
      {FOLDCAR_REFUSAL_HELD, Refusal::kHeld}, {FOLDCAR_REFUSAL_LATE, Refusal::kLate},
      {FOLDCAR_REFUSAL_NO_DESIGN, Refusal::kNoDesign}, {FOLDCAR_REFUSAL_UNKNOWN_COMMAND, Refusal::kUnknownCommand},
      {FOLDCAR_REFUSAL_NO_LOG, Refusal::kNoLog}, {FOLDCAR_REFUSAL_STORING, Refusal::kStoring},
      {FOLDCAR_REFUSAL_NO_BUTTON, Refusal::kNoButton}, {FOLDCAR_REFUSAL_DELAY, Refusal::kDelay}, {FOLDCAR_REFUSAL_UNKNOWN_PARAMETER, Refusal::kUnknownParameter},
      {FOLDCAR_REFUSAL_BELOW_MINIMUM, Refusal::kBelowMinimum}, {FOLDCAR_REFUSAL_ABOVE_MAXIMUM, Refusal::kAboveMaximum},
      {FOLDCAR_REFUSAL_NOT_AN_INTEGER, Refusal::kNotAnInteger}, {FOLDCAR_REFUSAL_NOT_A_SIGN, Refusal::kNotASign},
      {FOLDCAR_REFUSAL_FIXED, Refusal::kFixed}, {FOLDCAR_REFUSAL_NOT_SAVED, Refusal::kNotSaved},
      {FOLDCAR_REFUSAL_SERVO_BATTERY_LOW, Refusal::kServoBatteryLow}});
}

TEST(a_repeated_command_is_answered_again_and_not_obeyed_twice) {
  LinkBench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart).result);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart, 1).result);
  for (int i = 0; i < 26; ++i) bench.run(200, bench.host.heartbeat());
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart, 1).result);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart).result);
}

TEST(what_the_car_does_not_know_is_unsupported_and_what_is_for_others_is_left_alone) {
  LinkBench bench;
  bench.expect(MAV_RESULT_UNSUPPORTED, Refusal::kUnknownCommand, 22, {});
  mavlink_command_long_t command{};
  command.command = MAV_CMD_COMPONENT_ARM_DISARM;
  command.param1 = 1;
  command.target_system = 2;
  bench.run(40, bench.host.pack(mavlink_msg_command_long_encode_status, command));
  TEST_ASSERT_EQUAL_UINT(1, bench.host.acks().size());
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
}

TEST(the_board_restarts_on_request_but_not_while_it_drives) {
  LinkBench bench;
  bench.start(kStart);
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kRunning, MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, {1});
  bench.answer(MAV_CMD_FOLDCAR_STOP_TRIAL, {});
  TEST_ASSERT_FALSE(bench.board.board.restart_is_requested);
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, {1});
  TEST_ASSERT_TRUE(bench.board.board.restart_is_requested);
}

TEST(an_output_is_tested_by_the_standard_command) {
  LinkBench bench;
  const float output = ACTUATOR_OUTPUT_FUNCTION_SERVO1 + 2;
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_ACTUATOR_TEST, {-0.02f, 0.4f, 0, 0, output});
  PulsesUs expected{};
  expected[2] = 1490.0f;
  TEST_ASSERT_TRUE(bench.last_us() == expected);
  bench.run(400);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_ACTUATOR_TEST, {NAN, 1, 0, 0, output});
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  for (const std::vector<float>& wrong : std::vector<std::vector<float>>{
           {0, 4, 0, 0, output}, {1.1f, 1, 0, 0, output}, {0, 1, 0, 0, 41}, {0, 1, 0, 0, 32}}) {
    bench.expect(MAV_RESULT_DENIED, Refusal::kTest, MAV_CMD_ACTUATOR_TEST, wrong);
  }
}
