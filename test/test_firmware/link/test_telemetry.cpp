// Telemetry: intervals, order, requested messages, and which packets a slow link leaves out.
#include "../../suite.h"

#include <cmath>
#include <cstring>
#include <map>

#include "link_bench.h"

using namespace foldcar;

TEST(messages_come_at_their_intervals_without_drift) {
  LinkBench bench;
  bench.board.fit_imu();
  constexpr std::uint64_t kTimeS = 900;
  for (std::uint64_t s = 0; s < kTimeS; ++s) {
    bench.run(1000);
    if (s == 0) bench.host.received.clear();
    bench.board.servos.writes.clear();
  }
  TEST_ASSERT_EQUAL_INT(0, bench.host.bad_count);
  const std::size_t seconds = kTimeS - 1;
  const std::pair<std::uint32_t, std::size_t> kRates_hz[] = {
      {MAVLINK_MSG_ID_HEARTBEAT, 1},   {MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, 50}, {MAVLINK_MSG_ID_FOLDCAR_TRIAL, 10},
      {MAVLINK_MSG_ID_SYS_STATUS, 2},  {MAVLINK_MSG_ID_ATTITUDE, 10},         {MAVLINK_MSG_ID_SCALED_IMU, 10},
      {MAVLINK_MSG_ID_FOLDCAR_LOOP, 1}};
  for (const auto& [id, rate_hz] : kRates_hz) TEST_ASSERT_EQUAL_UINT(rate_hz * seconds, count_of(bench.host, id));
  // A ground station counts what is missing among the messages that it knows, for each component.
  std::map<std::uint8_t, std::uint8_t> next;
  for (const mavlink_message_t& message : bench.host.received) {
    const bool own = message.msgid >= MAVLINK_MSG_ID_FOLDCAR_TRIAL;
    TEST_ASSERT_EQUAL_UINT8(own ? kOwnComponent : kCarComponent, message.compid);
    const auto number = next.emplace(message.compid, message.seq).first;
    TEST_ASSERT_EQUAL_UINT8(number->second++, message.seq);
  }
  const auto pulses = bench.host.all<mavlink_servo_output_raw_t>(MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
                                                                 mavlink_msg_servo_output_raw_decode);
  for (std::size_t i = 1; i < pulses.size(); ++i) {
    TEST_ASSERT_EQUAL_UINT32(20000, pulses[i].time_usec - pulses[i - 1].time_usec);
  }
}

// It would delay what is new: each message that was missed is left out.
TEST(after_a_stall_telemetry_comes_at_its_intervals_and_not_in_a_burst) {
  LinkBench bench;
  bench.run(1000);
  bench.board.clock.time_us += 10000000;
  bench.host.received.clear();
  bench.run(1000);
  TEST_ASSERT_UINT_WITHIN(1, 10, count_of(bench.host, MAVLINK_MSG_ID_FOLDCAR_TRIAL));
  TEST_ASSERT_UINT_WITHIN(1, 1, count_of(bench.host, MAVLINK_MSG_ID_HEARTBEAT));
  TEST_ASSERT_UINT_WITHIN(1, 2, count_of(bench.host, MAVLINK_MSG_ID_SYS_STATUS));
  TEST_ASSERT_UINT_WITHIN(1, 50, count_of(bench.host, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW));
}

TEST(messages_can_be_asked_for_and_their_intervals_set) {
  LinkBench bench;
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_AUTOPILOT_VERSION});
  const auto version = bench.host.all<mavlink_autopilot_version_t>(MAVLINK_MSG_ID_AUTOPILOT_VERSION,
                                                                   mavlink_msg_autopilot_version_decode);
  TEST_ASSERT_EQUAL_UINT(1, version.size());
  TEST_ASSERT_EQUAL_HEX8(0x00, version[0].flight_custom_version[0]);
  TEST_ASSERT_EQUAL_HEX8(0x11, version[0].flight_custom_version[1]);
  TEST_ASSERT_EQUAL_HEX8(0xFF, version[0].flight_custom_version[7]);
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_SET_MESSAGE_INTERVAL,
               {MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, 100000});
  bench.host.received.clear();
  bench.run(1000);
  TEST_ASSERT_EQUAL_UINT(10, count_of(bench.host, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW));
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_SET_MESSAGE_INTERVAL, {MAVLINK_MSG_ID_HEARTBEAT, -1});
  bench.host.received.clear();
  bench.run(3000);
  TEST_ASSERT_EQUAL_UINT(0, count_of(bench.host, MAVLINK_MSG_ID_HEARTBEAT));
  for (const std::vector<float>& wrong :
       std::vector<std::vector<float>>{{MAVLINK_MSG_ID_HEARTBEAT, 19999}, {MAVLINK_MSG_ID_HEARTBEAT, NAN}, {33, 100000}}) {
    bench.expect(MAV_RESULT_DENIED, Refusal::kMessage, MAV_CMD_SET_MESSAGE_INTERVAL, wrong);
  }
  TEST_ASSERT_EQUAL_UINT_MESSAGE(0, count_of(bench.host, MAVLINK_MSG_ID_ATTITUDE), "there is no IMU");
  bench.expect(MAV_RESULT_DENIED, Refusal::kMessage, MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_ATTITUDE});
}

// Its serial port may have been closed when the board started again.
TEST(a_host_that_connects_is_told_once_where_the_last_run_crashed) {
  LinkBench bench;
  bench.run(3000, bench.host.heartbeat());
  TEST_ASSERT_EQUAL_UINT(0, count_of(bench.host, MAVLINK_MSG_ID_FOLDCAR_CRASH));
  bench.expect(MAV_RESULT_DENIED, Refusal::kMessage, MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_FOLDCAR_CRASH});
  bench.board.board.reason = ResetReason::kTaskWatchdog;
  CrashReport& report = bench.board.board.crash.emplace();
  report.cause = 28;
  report.data_address = 4;
  report.addresses[0] = 0x400D1234;
  report.addresses[CrashReport::kMaxAddresses - 1] = 0x400D5678;
  MavlinkHost other(200);
  for (int i = 0; i < 5; ++i) bench.run(1000, bench.host.heartbeat() + other.heartbeat());
  bench.run(1000, bench.host.heartbeat());
  const auto crashes =
      bench.host.all<mavlink_foldcar_crash_t>(MAVLINK_MSG_ID_FOLDCAR_CRASH, mavlink_msg_foldcar_crash_decode);
  TEST_ASSERT_EQUAL_UINT_MESSAGE(1, crashes.size(), "for the other host, which is new");
  TEST_ASSERT_EQUAL_HEX32(0x400D1234, crashes[0].address[0]);
  TEST_ASSERT_EQUAL_HEX32(0, crashes[0].address[1]);
  TEST_ASSERT_EQUAL_HEX32(0x400D5678, crashes[0].address[11]);
  TEST_ASSERT_EQUAL_HEX32(4, crashes[0].data_address);
  TEST_ASSERT_EQUAL_UINT8(28, crashes[0].cause);
  TEST_ASSERT_EQUAL_UINT8(6, crashes[0].reset_reason);
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_FOLDCAR_CRASH});
  TEST_ASSERT_EQUAL_UINT(2, count_of(bench.host, MAVLINK_MSG_ID_FOLDCAR_CRASH));
}

TEST(a_link_that_takes_little_gets_whole_packets_and_answers_first) {
  LinkBench bench;
  bench.run(1000);
  bench.host.received.clear();
  bench.board.link.room = 5;  // 1250 bytes a second are fewer than the telemetry
  bench.board.fit_imu();
  for (int i = 0; i < 50; ++i) bench.run(100, bench.host.command(MAV_CMD_FOLDCAR_STOP_TRIAL, {}));
  bench.board.link.room = 100000;
  bench.run(100);
  TEST_ASSERT_EQUAL_INT(0, bench.host.bad_count);
  TEST_ASSERT_EQUAL_UINT(50, bench.host.acks().size());
  bench.answer(MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_FOLDCAR_LOOP});
  const auto loops = bench.host.all<mavlink_foldcar_loop_t>(MAVLINK_MSG_ID_FOLDCAR_LOOP, mavlink_msg_foldcar_loop_decode);
  TEST_ASSERT_TRUE(loops.back().unsent_count > 10);
}

TEST(a_refused_design_is_told_in_full_and_other_designs_by_name) {
  DesignResult design;
  design.source = DesignSource::kRefused;
  std::strcpy(design.problem, "car.json: wheels[1].channel is not a whole number from 1 to 8, and more than 50 bytes");
  LinkBench bench(design);
  bench.run(20);
  TEST_ASSERT_EQUAL_STRING(design.problem, bench.last_text().c_str());
  bench.answer(MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, {});
  bench.host.received.clear();
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kDesign, MAV_CMD_COMPONENT_ARM_DISARM, {1});
  TEST_ASSERT_EQUAL_STRING((std::string("refused: ") + design.problem).c_str(), bench.last_text().c_str());
  bench.host.received.clear();
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_FOLDCAR_DESIGN});
  TEST_ASSERT_EQUAL_STRING(design.problem, bench.last_text().c_str());
  const auto told =
      bench.host.all<mavlink_foldcar_design_t>(MAVLINK_MSG_ID_FOLDCAR_DESIGN, mavlink_msg_foldcar_design_decode);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_DESIGN_SOURCE_REFUSED, told[0].source);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_HARDWARE_SIMULATED, told[0].hardware);
  TEST_ASSERT_EQUAL_STRING_LEN(kBuild, told[0].build, 16);
}

TEST(clocks_are_compared_and_pings_answered) {
  LinkBench bench;
  mavlink_timesync_t sync{};
  sync.ts1 = 123456789;
  bench.run(4, bench.host.pack(mavlink_msg_timesync_encode_status, sync));
  const auto syncs = bench.host.all<mavlink_timesync_t>(MAVLINK_MSG_ID_TIMESYNC, mavlink_msg_timesync_decode);
  TEST_ASSERT_EQUAL_UINT(1, syncs.size());
  TEST_ASSERT_EQUAL_INT64(123456789, syncs[0].ts1);
  TEST_ASSERT_EQUAL_INT64(1000 * static_cast<std::int64_t>(bench.board.clock.time_us), syncs[0].tc1);
  mavlink_ping_t ping{};
  ping.seq = 42;
  bench.run(4, bench.host.pack(mavlink_msg_ping_encode_status, ping));
  const auto pings = bench.host.all<mavlink_ping_t>(MAVLINK_MSG_ID_PING, mavlink_msg_ping_decode);
  TEST_ASSERT_EQUAL_UINT(1, pings.size());
  TEST_ASSERT_EQUAL_UINT(42, pings[0].seq);
  TEST_ASSERT_EQUAL_UINT(255, pings[0].target_system);
}

// MAVLink's axes point forward, right, down: turning left is negative.
TEST(the_attitude_has_mavlinks_signs) {
  LinkBench bench;
  bench.board.fit_imu();
  bench.board.imu.now.rate_rad_s = {0.0f, 0.0f, 1.0f};
  bench.run(1000);
  const auto attitudes = bench.host.all<mavlink_attitude_t>(MAVLINK_MSG_ID_ATTITUDE, mavlink_msg_attitude_decode);
  TEST_ASSERT_FLOAT_WITHIN(0.1f, -1.0f, attitudes.back().yaw);
  TEST_ASSERT_FLOAT_WITHIN(1e-3f, -1.0f, attitudes.back().yawspeed);
  bench.board.imu.now.rate_rad_s = {};
  bench.board.imu.now.acceleration_m_s2 = {4.9f, 0.0f, 8.5f};  // nose up
  bench.run(3000);
  const auto pitched = bench.host.all<mavlink_attitude_t>(MAVLINK_MSG_ID_ATTITUDE, mavlink_msg_attitude_decode);
  TEST_ASSERT_FLOAT_WITHIN(0.02f, 0.52f, pitched.back().pitch);
}

// A loop that comes round every 7 ms finds each tick up to 6 ms late, and makes none of the next later.
TEST(ticks_do_not_drift) {
  LinkBench bench;
  const std::size_t before = bench.board.servos.writes.size();
  for (int i = 0; i < 2000; ++i) {
    bench.board.clock.time_us += 7000;
    bench.firmware.poll();
  }
  TEST_ASSERT_UINT_WITHIN(1, 700, bench.board.servos.writes.size() - before);
}
