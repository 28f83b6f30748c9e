// The host that armed the car holds it: others are refused, and without it the car disarms.
#include "../../suite.h"

#include "link_bench.h"

using namespace foldcar;

// Sends a heartbeat and a packet of another host; returns the last acknowledgement.
static mavlink_command_ack_t answer_to(MavlinkHost& other, LinkBench& bench, const std::string& packet) {
  bench.run(20, other.heartbeat() + packet);
  return bench.host.acks().back();
}

// Nor by a command marked as a repetition: what it repeats, the arming, is another host's.
TEST(another_host_cannot_drive_a_car_that_this_one_has_armed) {
  for (MavlinkHost other : {MavlinkHost(200, 190), MavlinkHost(255, 230)}) {
    LinkBench bench;
    bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
    TEST_ASSERT_EQUAL_STRING("armed by host 255/190", bench.last_text().c_str());
    bench.run(20, other.heartbeat());
    for (const auto& [command, values] : std::vector<std::pair<std::uint16_t, std::vector<float>>>{
             {MAV_CMD_COMPONENT_ARM_DISARM, {1}},
             {MAV_CMD_FOLDCAR_START_TRIAL, kStart},
             {MAV_CMD_ACTUATOR_TEST, {0, 1, 0, 0, ACTUATOR_OUTPUT_FUNCTION_SERVO1}},
             {MAV_CMD_PREFLIGHT_STORAGE, {2}},
             {MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, {1}}}) {
      for (const std::uint8_t confirmation : {1, 0}) {
        const mavlink_command_ack_t ack = answer_to(other, bench, other.command(command, values, confirmation));
        TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, ack.result);
        TEST_ASSERT_TRUE(bench.last_refusal() == Refusal::kHeld);
        TEST_ASSERT_EQUAL_STRING("refused: host 255/190 holds the car", bench.last_text().c_str());
      }
    }
    answer_to(other, bench, other.set_parameter("STAGGER_MS", 77.0f));
    TEST_ASSERT_EQUAL_STRING("STAGGER_MS is not set: host 255/190 holds the car", bench.last_text().c_str());
    TEST_ASSERT_EQUAL_FLOAT(40.0f, bench.host.parameters().back().param_value);
    const std::size_t before = bench.host.texts().size();
    for (int i = 0; i < 20; ++i) bench.run(100, other.stick(500) + bench.host.heartbeat());
    TEST_ASSERT_EQUAL_UINT_MESSAGE(before + 1, bench.host.texts().size(), "a stick is refused once in a while");
    TEST_ASSERT_TRUE(bench.last_us() == kOff);
    TEST_ASSERT_FALSE(bench.board.board.restart_is_requested);
    TEST_ASSERT_TRUE(bench.state() == State::kArmed);
    TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart).result);
  }
}

// To stand is safe, so whoever sees a reason may ask for it.
TEST(every_host_may_stop_and_disarm_and_is_named) {
  LinkBench bench;
  MavlinkHost other(200);
  bench.start(kStart);
  answer_to(other, bench, other.command(MAV_CMD_FOLDCAR_STOP_TRIAL, {}));
  TEST_ASSERT_TRUE(bench.state() == State::kFinished);
  TEST_ASSERT_EQUAL_STRING("stopped by host 200/190", bench.last_text().c_str());
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  answer_to(other, bench, other.command(MAV_CMD_COMPONENT_ARM_DISARM, {0}));
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
  TEST_ASSERT_EQUAL_STRING("disarmed by host 200/190", bench.last_text().c_str());
  const mavlink_command_ack_t ack = answer_to(other, bench, other.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, ack.result);
  TEST_ASSERT_EQUAL_UINT(200, ack.target_system);
}

TEST(a_car_that_is_left_alone_disarms_although_another_host_talks) {
  LinkBench bench;
  MavlinkHost other(200);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  for (int s = 0; s < 20; ++s) bench.run(1000, bench.host.heartbeat());
  TEST_ASSERT_TRUE(bench.state() == State::kArmed);
  for (int s = 0; s < 3; ++s) bench.run(1000, other.heartbeat());
  TEST_ASSERT_TRUE(bench.state() == State::kArmed);
  for (int s = 0; s < 3; ++s) bench.run(1000, other.heartbeat());
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
  TEST_ASSERT_EQUAL_STRING("disarmed: host 255/190 was silent for 5.0 s", bench.last_text().c_str());
  // The host that comes back is told too.
  bench.host.received.clear();
  bench.run(100, bench.host.heartbeat());
  TEST_ASSERT_EQUAL_STRING("disarmed: host 255/190 was silent for 5.0 s", bench.last_text().c_str());
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kNotArmed, MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  answer_to(other, bench, other.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  TEST_ASSERT_TRUE(bench.state() == State::kArmed);
}

TEST(what_is_wrong_is_told_to_every_host_that_comes) {
  DesignResult design;
  design.source = DesignSource::kUnreadable;
  LinkBench bench(design);
  bench.run(1000);
  for (const std::uint8_t system : {255, 200}) {
    bench.host.received.clear();
    MavlinkHost host(system);
    bench.run(100, host.heartbeat());
    TEST_ASSERT_EQUAL_UINT(2, bench.host.texts().size());
    TEST_ASSERT_EQUAL_STRING("fault: flash memory cannot be read", bench.host.texts()[0].c_str());
    TEST_ASSERT_EQUAL_STRING("load a design, or confirm that the parameters describe the car",
                             bench.host.texts()[1].c_str());
  }
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kFaultLatched, MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kNoDesign, MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, {});
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, {1});
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_COMPONENT_ARM_DISARM, {1});
}

TEST(ground_stations_modes_and_radio_control_are_refused) {
  LinkBench bench;
  constexpr std::uint16_t kDoSetMode = 176;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.expect(MAV_RESULT_UNSUPPORTED, Refusal::kUnknownCommand, kDoSetMode, {1, 15});
  TEST_ASSERT_EQUAL_STRING("refused: not a command of this car", bench.last_text().c_str());
  mavlink_set_mode_t mode{};
  mavlink_command_int_t command{};
  mavlink_rc_channels_override_t sticks{};
  mode.target_system = command.target_system = sticks.target_system = 1;
  bench.run(40, bench.host.pack(mavlink_msg_set_mode_encode_status, mode));
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_UNSUPPORTED, bench.host.acks().back().result);
  command.command = MAV_CMD_COMPONENT_ARM_DISARM;
  bench.run(40, bench.host.pack(mavlink_msg_command_int_encode_status, command));
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_COMMAND_LONG_ONLY, bench.host.acks().back().result);
  bench.host.received.clear();
  bench.run(40, bench.host.pack(mavlink_msg_rc_channels_override_encode_status, sticks));
  TEST_ASSERT_EQUAL_UINT(0, bench.host.texts().size());  // releases all channels
  sticks.chan3_raw = 1700;
  for (int i = 0; i < 40; ++i) bench.run(100, bench.host.pack(mavlink_msg_rc_channels_override_encode_status, sticks));
  TEST_ASSERT_EQUAL_UINT(1, bench.host.texts().size());
  TEST_ASSERT_EQUAL_STRING("refused: RC_CHANNELS_OVERRIDE: drive with MANUAL_CONTROL", bench.last_text().c_str());
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
}

// Ground stations take a custom mode of a rover for ArduPilot's mode of that number.
TEST(the_heartbeat_claims_no_mode_of_another_autopilot) {
  LinkBench bench;
  bench.run(1000);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.run(1000, bench.host.heartbeat());
  const auto beats = bench.host.all<mavlink_heartbeat_t>(MAVLINK_MSG_ID_HEARTBEAT, mavlink_msg_heartbeat_decode);
  TEST_ASSERT_EQUAL_UINT8(0, beats.front().base_mode);
  TEST_ASSERT_EQUAL_UINT8(MAV_MODE_FLAG_SAFETY_ARMED, beats.back().base_mode);
  TEST_ASSERT_EQUAL_UINT32(FOLDCAR_STATE_ARMED, beats.back().custom_mode);
}

// As QGroundControl does with every vehicle: PROTOCOL_VERSION, COMPONENT_INFORMATION, COMPONENT_METADATA, AVAILABLE_MODES.
TEST(a_ground_stations_questions_are_answered_without_a_warning) {
  LinkBench bench;
  for (const float message_id : {300.0f, 395.0f, 397.0f, 435.0f}) {
    bench.expect(MAV_RESULT_DENIED, Refusal::kMessage, MAV_CMD_REQUEST_MESSAGE, {message_id});
  }
  mavlink_mission_request_list_t request{};
  request.target_system = request.target_component = 1;
  request.mission_type = MAV_MISSION_TYPE_RALLY;
  bench.run(40, bench.host.pack(mavlink_msg_mission_request_list_encode_status, request));
  const auto counts =
      bench.host.all<mavlink_mission_count_t>(MAVLINK_MSG_ID_MISSION_COUNT, mavlink_msg_mission_count_decode);
  TEST_ASSERT_EQUAL_UINT(1, counts.size());
  TEST_ASSERT_EQUAL_UINT(0, counts[0].count);
  TEST_ASSERT_EQUAL_UINT8(MAV_MISSION_TYPE_RALLY, counts[0].mission_type);
  TEST_ASSERT_EQUAL_UINT8(255, counts[0].target_system);
  TEST_ASSERT_EQUAL_UINT(0, bench.host.texts().size());
}

TEST(a_host_that_speaks_mavlink_1_is_told_and_not_obeyed) {
  LinkBench bench;
  MavlinkHost host(255, 190);
  host.speak_mavlink_1();
  for (int i = 0; i < 20; ++i) {
    bench.run(100, host.heartbeat() + host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}) + host.set_parameter("TRACK_M", 0.2f));
  }
  TEST_ASSERT_EQUAL_UINT(1, bench.host.texts().size());
  TEST_ASSERT_EQUAL_STRING("refused: MAVLink 1: set the host to MAVLink 2", bench.last_text().c_str());
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
  TEST_ASSERT_EQUAL_UINT(0, bench.host.acks().size());
  TEST_ASSERT_EQUAL_UINT(0, bench.host.parameters().size());
}
