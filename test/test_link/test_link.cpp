// The firmware's end of the link over a recording HAL: packets, parameters, commands, telemetry, logs, link loss.
#include <unity.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <new>
#include <random>
#include <string>

#include "../link_fuzz.h"
#include "../mavlink_host.h"
#include "../recording_hal.h"
#include "firmware.h"
#include "packet_parser.h"

using namespace foldcar;

namespace {
std::size_t allocation_count = 0;
}

// Counts what takes memory from the heap, and otherwise does what the standard's own does. Inlined, the compiler would
// take malloc and delete for a wrong pair.
__attribute__((noinline)) void* operator new(std::size_t size) {
  ++allocation_count;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
__attribute__((noinline)) void operator delete(void* memory) noexcept { std::free(memory); }
__attribute__((noinline)) void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

void setUp() {}
void tearDown() {}

namespace {

constexpr const char* kBuild = "00112233445566ff";
constexpr PulsesUs kOff{};

// A car and a host with a perfect cable between them.
struct Bench {
  RecordingHal board;
  Firmware firmware{board.hal(), kBuild};
  MavlinkHost host;

  explicit Bench(const DesignResult& design = {}) {
    board.link.room = 100000;
    firmware.begin(design);
  }
  // The host's bytes arrive, and the firmware is polled every 4 ms for as long.
  void run(std::uint64_t time_ms, const std::string& bytes = "") {
    board.link.incoming += bytes;
    for (std::uint64_t t_ms = 0; t_ms < time_ms; t_ms += 4) {
      board.clock.time_us += 4000;
      firmware.poll();
    }
    host.hear(board.link.outgoing);
    board.link.outgoing.clear();
  }
  // The host shows itself first, as one does that sends heartbeats.
  mavlink_command_ack_t answer(std::uint16_t command, const std::vector<float>& parameters,
                               std::uint8_t confirmation = 0) {
    const std::size_t before = host.acks().size();
    run(20, host.heartbeat() + host.command(command, parameters, confirmation));
    TEST_ASSERT_EQUAL_UINT_MESSAGE(before + 1, host.acks().size(), "one answer to a command");
    return host.acks().back();
  }
  void expect(MAV_RESULT result, Refusal refusal, std::uint16_t command, const std::vector<float>& parameters) {
    const mavlink_command_ack_t ack = answer(command, parameters);
    TEST_ASSERT_EQUAL_UINT(command, ack.command);
    TEST_ASSERT_EQUAL_UINT(result, ack.result);
    TEST_ASSERT_EQUAL_INT(static_cast<int>(refusal), ack.result_param2);
    TEST_ASSERT_EQUAL_UINT(255, ack.target_system);
  }
  State state() const { return firmware.application().status().state; }
  const PulsesUs& last_us() const { return board.servos.writes.back(); }
};

std::size_t count_of(const MavlinkHost& host, std::uint32_t message_id) {
  std::size_t count = 0;
  for (const mavlink_message_t& message : host.heard) count += message.msgid == message_id ? 1 : 0;
  return count;
}

const std::vector<float> kStart = {0.3f, 0.0f, 20.0f, 0.0f, 7.0f};
const std::vector<float> kStartUntethered = {0.3f, 0.0f, 20.0f, 1.0f, 8.0f};

// Every byte is lost with that chance.
std::string through(const std::string& bytes, double loss, std::mt19937_64& random) {
  std::bernoulli_distribution is_lost(loss);
  std::string arrived;
  for (const char byte : bytes) {
    if (!is_lost(random)) arrived += byte;
  }
  return arrived;
}

}  // namespace

void messages_come_at_their_intervals_without_drift() {
  Bench bench;
  bench.board.imu.fitted = true;
  bench.board.imu.now.acceleration_m_s2 = {0.0f, 0.0f, 9.81f};
  constexpr std::uint64_t kTimeS = 1800;
  for (std::uint64_t s = 0; s < kTimeS; ++s) {
    bench.run(1000);
    if (s == 0) bench.host.heard.clear();
    bench.board.servos.writes.clear();
  }
  TEST_ASSERT_EQUAL_INT(0, bench.host.bad_count);
  const std::size_t seconds = kTimeS - 1;
  TEST_ASSERT_EQUAL_UINT(seconds, count_of(bench.host, MAVLINK_MSG_ID_HEARTBEAT));
  TEST_ASSERT_EQUAL_UINT(50 * seconds, count_of(bench.host, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW));
  TEST_ASSERT_EQUAL_UINT(10 * seconds, count_of(bench.host, MAVLINK_MSG_ID_FOLDCAR_TRIAL));
  TEST_ASSERT_EQUAL_UINT(2 * seconds, count_of(bench.host, MAVLINK_MSG_ID_SYS_STATUS));
  TEST_ASSERT_EQUAL_UINT(10 * seconds, count_of(bench.host, MAVLINK_MSG_ID_ATTITUDE));
  TEST_ASSERT_EQUAL_UINT(10 * seconds, count_of(bench.host, MAVLINK_MSG_ID_SCALED_IMU));
  TEST_ASSERT_EQUAL_UINT(seconds, count_of(bench.host, MAVLINK_MSG_ID_FOLDCAR_LOOP));
  std::uint8_t next = bench.host.heard.front().seq;
  for (const mavlink_message_t& message : bench.host.heard) TEST_ASSERT_EQUAL_UINT8(next++, message.seq);
  const auto pulses = bench.host.all<mavlink_servo_output_raw_t>(MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
                                                                 mavlink_msg_servo_output_raw_decode);
  for (std::size_t i = 1; i < pulses.size(); ++i) {
    TEST_ASSERT_EQUAL_UINT32(20000, pulses[i].time_usec - pulses[i - 1].time_usec);
  }
}

void a_car_without_an_imu_sends_no_attitude() {
  Bench bench;
  bench.run(1000);
  TEST_ASSERT_EQUAL_UINT(0, count_of(bench.host, MAVLINK_MSG_ID_ATTITUDE));
  bench.expect(MAV_RESULT_DENIED, Refusal::kMessage, MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_ATTITUDE});
}

void the_parameter_list_is_that_of_the_table() {
  Bench bench;
  bench.run(200, bench.host.request_list());
  const auto values = bench.host.parameters();
  TEST_ASSERT_EQUAL_UINT(kParameterCount, values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    TEST_ASSERT_EQUAL_UINT(i, values[i].param_index);
    TEST_ASSERT_EQUAL_UINT(kParameterCount, values[i].param_count);
    TEST_ASSERT_EQUAL_UINT(MAV_PARAM_TYPE_REAL32, values[i].param_type);
    TEST_ASSERT_EQUAL_STRING_LEN(parameter_table()[i].name, values[i].param_id, 16);
    TEST_ASSERT_TRUE(values[i].param_value == parameter_table()[i].default_value);
  }
}

// Of a request 4 % arrive, of the values 0.03 %; the host asks until it has all. Of so many damaged packets a few
// pass a checksum of 16 bits, hence a value counts when it has come twice.
void the_parameter_list_is_complete_over_a_link_that_drops_a_fifth_of_the_bytes() {
  Bench bench;
  std::mt19937_64 random(1);
  PacketParser reader;  // the reference parser loses whole packets behind each damaged one
  std::map<std::string, int> times_seen;
  std::map<int, std::string> known;
  for (int polls = 0; known.size() < kParameterCount && polls < 5000000; ++polls) {
    bench.board.link.incoming += through(bench.host.request_list(), 0.2, random);
    bench.board.clock.time_us += 4000;
    bench.firmware.poll();
    const std::string arrived = through(bench.board.link.outgoing, 0.2, random);
    bench.board.link.outgoing.clear();
    bench.board.servos.writes.clear();
    for (std::size_t fed = 0; fed < arrived.size();) {
      const auto* bytes = reinterpret_cast<const std::uint8_t*>(arrived.data());
      fed += reader.feed(bytes + fed, arrived.size() - fed, bench.board.clock.time_us);
      mavlink_message_t message;
      while (reader.next(message, bench.board.clock.time_us)) {
        if (message.msgid != MAVLINK_MSG_ID_PARAM_VALUE) continue;
        mavlink_param_value_t value;
        mavlink_msg_param_value_decode(&message, &value);
        const std::string content(reinterpret_cast<const char*>(&value), sizeof value);
        if (++times_seen[content] == 2) known[value.param_index] = content;
      }
    }
  }
  TEST_ASSERT_EQUAL_UINT(kParameterCount, known.size());
  for (std::size_t i = 0; i < kParameterCount; ++i) {
    mavlink_param_value_t value;
    std::memcpy(&value, known[static_cast<int>(i)].data(), sizeof value);
    TEST_ASSERT_EQUAL_STRING_LEN(parameter_table()[i].name, value.param_id, 16);
    TEST_ASSERT_TRUE(value.param_value == parameter_table()[i].default_value);
  }
}

void a_parameter_is_set_or_the_value_that_holds_comes_back_with_the_reason() {
  Bench bench;
  const auto value_after = [&bench](const char* name, float value) {
    bench.host.heard.clear();
    bench.run(20, bench.host.set_parameter(name, value));
    TEST_ASSERT_EQUAL_UINT(1, bench.host.parameters().size());
    return bench.host.parameters().front().param_value;
  };
  TEST_ASSERT_EQUAL_FLOAT(0.2f, value_after("TRACK_M", 0.2f));
  TEST_ASSERT_EQUAL_UINT(0, bench.host.texts().size());
  TEST_ASSERT_EQUAL_FLOAT(0.2f, bench.board.storage.values["TRACK_M"]);
  TEST_ASSERT_EQUAL_FLOAT(0.2f, value_after("TRACK_M", -1.0f));
  TEST_ASSERT_EQUAL_STRING("TRACK_M is below its minimum", bench.host.texts().back().c_str());
  TEST_ASSERT_EQUAL_FLOAT(0.2f, value_after("TRACK_M", NAN));
  TEST_ASSERT_EQUAL_FLOAT(1.0f, value_after("CH1_SIDE", 1.5f));
  TEST_ASSERT_EQUAL_STRING("CH1_SIDE is not a whole number", bench.host.texts().back().c_str());
  bench.board.storage.accepts = false;
  TEST_ASSERT_EQUAL_FLOAT(0.3f, value_after("TRACK_M", 0.3f));
  TEST_ASSERT_EQUAL_STRING("TRACK_M is set, but could not be saved", bench.host.texts().back().c_str());
  bench.board.storage.accepts = true;
  bench.host.heard.clear();
  bench.run(20, bench.host.set_parameter("NO_SUCH_NAME_16X", 1.0f));
  TEST_ASSERT_EQUAL_UINT(0, bench.host.parameters().size());
  TEST_ASSERT_EQUAL_STRING("NO_SUCH_NAME_16X is not a parameter", bench.host.texts().back().c_str());
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  TEST_ASSERT_EQUAL_FLOAT(0.3f, value_after("TRACK_M", 0.1f));
  TEST_ASSERT_EQUAL_STRING("TRACK_M cannot be set while wheels are driven", bench.host.texts().back().c_str());
}

void one_parameter_is_read_by_index_or_by_name() {
  Bench bench;
  mavlink_param_request_read_t request{};
  request.target_system = 1;
  request.param_index = 3;
  bench.run(20, bench.host.pack(mavlink_msg_param_request_read_encode_status, request));
  request.param_index = -1;
  std::memcpy(request.param_id, "CH8_GAIN_US", 11);
  bench.run(20, bench.host.pack(mavlink_msg_param_request_read_encode_status, request));
  request.param_index = 1000;
  bench.run(20, bench.host.pack(mavlink_msg_param_request_read_encode_status, request));
  const auto values = bench.host.parameters();
  TEST_ASSERT_EQUAL_UINT(2, values.size());
  TEST_ASSERT_EQUAL_STRING("SLEW_US_PER_S", values[0].param_id);
  TEST_ASSERT_EQUAL_STRING("CH8_GAIN_US", values[1].param_id);
}

void a_trial_goes_from_arming_to_its_end_by_commands() {
  Bench bench;
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kNotArmed, MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  TEST_ASSERT_EQUAL_STRING("refused: not armed", bench.host.texts().back().c_str());
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_COMPONENT_ARM_DISARM, {1});
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  bench.expect(MAV_RESULT_DENIED, Refusal::kSpeedLimit, MAV_CMD_FOLDCAR_START_TRIAL, {6, 0, 1});
  bench.expect(MAV_RESULT_DENIED, Refusal::kNotANumber, MAV_CMD_FOLDCAR_START_TRIAL, {NAN, 0, 1});
  bench.expect(MAV_RESULT_DENIED, Refusal::kNotANumber, MAV_CMD_FOLDCAR_START_TRIAL, {0.1f, 0, 1, 2});
  bench.expect(MAV_RESULT_DENIED, Refusal::kTimeLimit, MAV_CMD_FOLDCAR_START_TRIAL, {0.1f, 0, 0});
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

void every_enum_of_the_firmware_has_the_dialects_values() {
  TEST_ASSERT_EQUAL_INT(FOLDCAR_STATE_DISARMED, static_cast<int>(State::kDisarmed));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_STATE_ARMED, static_cast<int>(State::kArmed));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_STATE_RUNNING, static_cast<int>(State::kRunning));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_STATE_FINISHED, static_cast<int>(State::kFinished));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_STATE_FAULT, static_cast<int>(State::kFault));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_STATE_MANUAL, static_cast<int>(State::kManual));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_STATE_TESTING, static_cast<int>(State::kTesting));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_FAULT_BUS, static_cast<int>(Fault::kBus));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_FAULT_BATTERY_UNREADABLE, static_cast<int>(Fault::kBatteryUnreadable));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_FAULT_BATTERY_LOW, static_cast<int>(Fault::kBatteryLow));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_FAULT_COMMAND_STALE, static_cast<int>(Fault::kCommandStale));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_FAULT_STORED_PARAMETER, static_cast<int>(Fault::kStoredParameter));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_FAULT_DESIGN, static_cast<int>(Fault::kDesign));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_FAULT_WATCHDOG, static_cast<int>(Fault::kWatchdog));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_FAULT_BROWN_OUT, static_cast<int>(Fault::kBrownOut));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_FAULT_TILT, static_cast<int>(Fault::kTilt));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_FAULT_IMU, static_cast<int>(Fault::kImu));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_END_TIME_LIMIT, static_cast<int>(TrialEnd::kTimeLimit));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_END_STOPPED, static_cast<int>(TrialEnd::kStopped));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_END_DISARMED, static_cast<int>(TrialEnd::kDisarmed));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_END_FAULT, static_cast<int>(TrialEnd::kFault));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_DESIGN_SOURCE_FILE, static_cast<int>(DesignSource::kFile));
  TEST_ASSERT_EQUAL_INT(FOLDCAR_DESIGN_SOURCE_REFUSED, static_cast<int>(DesignSource::kRefused));
  // docs/link.md names the last of the reasons by these numbers.
  TEST_ASSERT_EQUAL_INT(12, static_cast<int>(Refusal::kTimeLimit));
  TEST_ASSERT_EQUAL_INT(17, static_cast<int>(Refusal::kStranger));
}

void a_repeated_command_is_answered_again_and_not_obeyed_twice() {
  Bench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart).result);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart, 1).result);
  for (int i = 0; i < 26; ++i) bench.run(200, bench.host.heartbeat());
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart, 1).result);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart).result);
}

void what_the_car_does_not_know_is_unsupported_and_what_is_for_others_is_left_alone() {
  Bench bench;
  bench.expect(MAV_RESULT_UNSUPPORTED, Refusal::kNone, 22, {});
  mavlink_command_long_t command{};
  command.command = MAV_CMD_COMPONENT_ARM_DISARM;
  command.param1 = 1;
  command.target_system = 2;
  bench.run(40, bench.host.pack(mavlink_msg_command_long_encode_status, command));
  TEST_ASSERT_EQUAL_UINT(1, bench.host.acks().size());
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
}

void messages_can_be_asked_for_and_their_intervals_set() {
  Bench bench;
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_AUTOPILOT_VERSION});
  const auto version = bench.host.all<mavlink_autopilot_version_t>(MAVLINK_MSG_ID_AUTOPILOT_VERSION,
                                                                   mavlink_msg_autopilot_version_decode);
  TEST_ASSERT_EQUAL_UINT(1, version.size());
  TEST_ASSERT_EQUAL_HEX8(0x00, version[0].flight_custom_version[0]);
  TEST_ASSERT_EQUAL_HEX8(0x11, version[0].flight_custom_version[1]);
  TEST_ASSERT_EQUAL_HEX8(0xFF, version[0].flight_custom_version[7]);
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_SET_MESSAGE_INTERVAL,
               {MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, 100000});
  bench.host.heard.clear();
  bench.run(1000);
  TEST_ASSERT_EQUAL_UINT(10, count_of(bench.host, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW));
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_SET_MESSAGE_INTERVAL, {MAVLINK_MSG_ID_HEARTBEAT, -1});
  bench.host.heard.clear();
  bench.run(3000);
  TEST_ASSERT_EQUAL_UINT(0, count_of(bench.host, MAVLINK_MSG_ID_HEARTBEAT));
  bench.expect(MAV_RESULT_DENIED, Refusal::kMessage, MAV_CMD_SET_MESSAGE_INTERVAL, {MAVLINK_MSG_ID_HEARTBEAT, 19999});
  bench.expect(MAV_RESULT_DENIED, Refusal::kMessage, MAV_CMD_SET_MESSAGE_INTERVAL, {MAVLINK_MSG_ID_HEARTBEAT, NAN});
  bench.expect(MAV_RESULT_DENIED, Refusal::kMessage, MAV_CMD_SET_MESSAGE_INTERVAL, {33, 100000});
}

// A thousand trials, the host falls silent at any moment of any of them, also between two ticks.
void pulses_are_off_within_half_a_second_of_link_loss_a_thousand_times() {
  std::mt19937_64 random(2);
  std::uniform_int_distribution<std::uint64_t> any_us(0, 3000000);
  for (int trial = 0; trial < 1000; ++trial) {
    Bench bench;
    bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
    bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart);
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
    TEST_ASSERT_TRUE(bench.firmware.application().status().fault == Fault::kCommandStale);
    TEST_ASSERT_TRUE(off_us > last_heard_us + 400000);
    TEST_ASSERT_TRUE(off_us <= last_heard_us + 500000);
  }
}

void only_the_host_that_drives_keeps_a_trial_alive() {
  Bench bench;
  MavlinkHost other(200);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  for (int i = 0; i < 5; ++i) bench.run(100, other.heartbeat());
  TEST_ASSERT_TRUE(bench.firmware.application().status().fault == Fault::kCommandStale);
  TEST_ASSERT_EQUAL_STRING("fault: no command from the host", bench.host.texts().back().c_str());
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kFaultLatched, MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, {});
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
}

void the_stick_drives_and_its_silence_stops() {
  Bench bench;
  mavlink_manual_control_t stick{};
  stick.target = 1;
  stick.x = 500;
  const auto bytes = [&] { return bench.host.pack(mavlink_msg_manual_control_encode_status, stick); };
  bench.run(100, bytes());
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.run(100, bytes());
  TEST_ASSERT_TRUE(bench.state() == State::kManual);
  for (int i = 0; i < 10; ++i) bench.run(100, bytes());
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1500.0f + 45.0f + 77.5f, bench.last_us()[0]);
  stick.x = INT16_MAX;  // "axis is invalid"
  for (int i = 0; i < 10; ++i) bench.run(100, bytes());
  TEST_ASSERT_EQUAL_FLOAT(1500.0f, bench.last_us()[0]);
  bench.run(500);
  TEST_ASSERT_TRUE(bench.state() == State::kFault);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
}

void a_single_packet_sets_nothing_in_motion() {
  Bench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.run(2100);
  bench.run(40, bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, kStart));
  TEST_ASSERT_EQUAL_INT(static_cast<int>(Refusal::kStranger), bench.host.acks().back().result_param2);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  mavlink_manual_control_t stick{};
  stick.target = 1;
  stick.x = 500;
  bench.run(2100);
  bench.run(40, bench.host.pack(mavlink_msg_manual_control_encode_status, stick));
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {0});
  bench.run(2100);
  bench.run(40, bench.host.command(MAV_CMD_ACTUATOR_TEST, {0, 1, 0, 0, ACTUATOR_OUTPUT_FUNCTION_SERVO1}));
  TEST_ASSERT_EQUAL_INT(static_cast<int>(Refusal::kStranger), bench.host.acks().back().result_param2);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
}

void an_output_is_tested_by_the_standard_command() {
  Bench bench;
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
  bench.expect(MAV_RESULT_DENIED, Refusal::kTest, MAV_CMD_ACTUATOR_TEST, {0, 4, 0, 0, output});
  bench.expect(MAV_RESULT_DENIED, Refusal::kTest, MAV_CMD_ACTUATOR_TEST, {1.1f, 1, 0, 0, output});
  bench.expect(MAV_RESULT_DENIED, Refusal::kTest, MAV_CMD_ACTUATOR_TEST, {0, 1, 0, 0, 41});
  bench.expect(MAV_RESULT_DENIED, Refusal::kTest, MAV_CMD_ACTUATOR_TEST, {0, 1, 0, 0, 32});
}

void clocks_are_compared_and_pings_answered() {
  Bench bench;
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

void an_untethered_trial_is_recorded_and_can_be_fetched() {
  Bench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStartUntethered);
  bench.run(19000);
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
  bench.run(2000);
  TEST_ASSERT_TRUE(bench.state() == State::kFinished);
  TEST_ASSERT_EQUAL_UINT(1, bench.board.logs.logs.size());
  const std::string& stored = bench.board.logs.logs[1];

  bench.host.heard.clear();
  mavlink_log_request_list_t list{};
  list.target_system = list.target_component = 1;
  list.end = 0xFFFF;
  bench.run(40, bench.host.pack(mavlink_msg_log_request_list_encode_status, list));
  const auto entries = bench.host.all<mavlink_log_entry_t>(MAVLINK_MSG_ID_LOG_ENTRY, mavlink_msg_log_entry_decode);
  TEST_ASSERT_EQUAL_UINT(1, entries.size());
  TEST_ASSERT_EQUAL_UINT(1, entries[0].num_logs);
  TEST_ASSERT_EQUAL_UINT(stored.size(), entries[0].size);

  mavlink_log_request_data_t data{};
  data.target_system = data.target_component = 1;
  data.id = entries[0].id;
  data.count = UINT32_MAX;
  bench.run(8000, bench.host.pack(mavlink_msg_log_request_data_encode_status, data));
  std::string fetched;
  for (const auto& part : bench.host.all<mavlink_log_data_t>(MAVLINK_MSG_ID_LOG_DATA, mavlink_msg_log_data_decode)) {
    TEST_ASSERT_EQUAL_UINT(fetched.size(), part.ofs);
    fetched.append(reinterpret_cast<const char*>(part.data), part.count);
  }
  TEST_ASSERT_TRUE(fetched == stored);

  MavlinkHost reader;
  std::uint64_t last_us = 0;
  for (std::size_t at = 0; at < fetched.size();) {
    std::uint64_t t_us = 0;
    for (int i = 0; i < 8; ++i) t_us = (t_us << 8) | static_cast<std::uint8_t>(fetched[at++]);
    TEST_ASSERT_TRUE(t_us >= last_us);
    last_us = t_us;
    const std::size_t size = 12 + static_cast<std::uint8_t>(fetched[at + 1]);
    reader.hear(fetched.substr(at, size));
    at += size;
  }
  TEST_ASSERT_EQUAL_INT(0, reader.bad_count);
  TEST_ASSERT_EQUAL_UINT32(MAVLINK_MSG_ID_FOLDCAR_DESIGN, reader.heard.front().msgid);
  TEST_ASSERT_UINT_WITHIN(2, 5 * 20, count_of(reader, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW));
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, reader.trials().back().end);
  TEST_ASSERT_EQUAL_UINT32(8, reader.trials().back().trial_id);
}

void the_newest_logs_are_kept_and_all_can_be_erased() {
  Bench bench;
  for (int i = 0; i < 6; ++i) {
    bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
    bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStartUntethered);
    bench.run(300);
    bench.answer(MAV_CMD_FOLDCAR_STOP_TRIAL, {});
  }
  TEST_ASSERT_EQUAL_UINT(kLogsKept, bench.board.logs.logs.size());
  TEST_ASSERT_EQUAL_UINT(3, bench.board.logs.logs.begin()->first);
  mavlink_log_erase_t erase{};
  erase.target_system = 1;
  bench.run(20, bench.host.pack(mavlink_msg_log_erase_encode_status, erase));
  TEST_ASSERT_EQUAL_UINT(0, bench.board.logs.logs.size());
}

void the_longest_trial_fits_its_log() {
  Bench bench;
  bench.board.imu.fitted = true;
  bench.board.imu.now.acceleration_m_s2 = {0.3f, -0.2f, 9.81f};
  bench.run(20, bench.host.set_parameter("TRIAL_MAX_S", 3600));
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 3600, 1, 9});
  for (int s = 0; s < 3602; ++s) {
    bench.run(1000);
    bench.host.heard.clear();
    bench.board.servos.writes.resize(1);
  }
  const std::string& stored = bench.board.logs.logs[1];
  TEST_ASSERT_TRUE(stored.size() <= kLargestLog);
  TEST_ASSERT_TRUE(stored.size() > kLargestLog - 2048);
  MavlinkHost reader;
  reader.hear(stored.substr(stored.size() - 40));
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, reader.trials().back().end);
}

void a_link_that_takes_little_gets_whole_packets_and_answers_first() {
  Bench bench;
  bench.run(1000);
  bench.host.heard.clear();
  bench.board.link.room = 5;  // 1250 bytes a second are fewer than the telemetry
  bench.board.imu.fitted = true;
  bench.board.imu.now.acceleration_m_s2 = {0.0f, 0.0f, 9.81f};
  for (int i = 0; i < 50; ++i) bench.run(100, bench.host.command(MAV_CMD_FOLDCAR_STOP_TRIAL, {}));
  bench.board.link.room = 100000;
  bench.run(100);
  TEST_ASSERT_EQUAL_INT(0, bench.host.bad_count);
  TEST_ASSERT_EQUAL_UINT(50, bench.host.acks().size());
  bench.answer(MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_FOLDCAR_LOOP});
  const auto loops = bench.host.all<mavlink_foldcar_loop_t>(MAVLINK_MSG_ID_FOLDCAR_LOOP, mavlink_msg_foldcar_loop_decode);
  TEST_ASSERT_TRUE(loops.back().unsent_count > 10);
}

void a_refused_design_is_told_in_full_and_other_designs_by_name() {
  DesignResult design;
  design.source = DesignSource::kRefused;
  std::strcpy(design.problem, "car.json: wheels[1].channel is not a whole number from 1 to 8, and more than 50 bytes");
  Bench bench(design);
  bench.run(20);
  TEST_ASSERT_EQUAL_STRING(design.problem, bench.host.texts().back().c_str());
  bench.answer(MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, {});
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kDesign, MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.host.heard.clear();
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_FOLDCAR_DESIGN});
  TEST_ASSERT_EQUAL_STRING(design.problem, bench.host.texts().back().c_str());
  const auto told =
      bench.host.all<mavlink_foldcar_design_t>(MAVLINK_MSG_ID_FOLDCAR_DESIGN, mavlink_msg_foldcar_design_decode);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_DESIGN_SOURCE_REFUSED, told[0].source);
  TEST_ASSERT_EQUAL_STRING_LEN(kBuild, told[0].build, 16);
}

void the_board_restarts_on_request_but_not_while_it_drives() {
  Bench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  bench.expect(MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kRunning, MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, {1});
  bench.answer(MAV_CMD_FOLDCAR_STOP_TRIAL, {});
  TEST_ASSERT_FALSE(bench.board.board.restart_is_requested);
  bench.expect(MAV_RESULT_ACCEPTED, Refusal::kNone, MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, {1});
  TEST_ASSERT_TRUE(bench.board.board.restart_is_requested);
}

void after_set_up_nothing_is_taken_from_the_heap() {
  Bench bench;
  bench.board.imu.fitted = true;
  bench.board.imu.now.acceleration_m_s2 = {0.0f, 0.0f, 9.81f};
  bench.board.servos.writes.reserve(100000);
  bench.board.link.outgoing.reserve(1000000);
  bench.board.link.incoming.reserve(10000);
  bench.board.storage.values["TRACK_M"] = 0.1f;
  const std::string requests = bench.host.heartbeat() + bench.host.request_list() +
                               bench.host.set_parameter("TRACK_M", 0.2f) + bench.host.set_parameter("TRACK_M", -1.0f) +
                               bench.host.command(MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_FOLDCAR_DESIGN}) +
                               bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}) +
                               bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  const std::string heartbeat = bench.host.heartbeat();
  const std::size_t before = allocation_count;
  bench.board.link.incoming += requests;
  for (int poll = 0; poll < 5500; ++poll) {
    if (poll % 50 == 0) bench.board.link.incoming += heartbeat;
    bench.board.clock.time_us += 4000;
    bench.firmware.poll();
  }
  TEST_ASSERT_EQUAL_UINT(before, allocation_count);
  TEST_ASSERT_TRUE(bench.firmware.application().trial_end() == TrialEnd::kTimeLimit);
  TEST_ASSERT_EQUAL_FLOAT(0.2f, bench.board.storage.values["TRACK_M"]);
}

void packets_are_found_among_noise_and_behind_false_starts() {
  MavlinkHost host;
  const std::string packet = host.heartbeat();
  const std::string false_start = std::string("\xfd\x09\x00\x00\x00\x01\x01\x00\x00\x00", 10);  // of a HEARTBEAT
  const std::string impossible = std::string("\xfd\xff\x00\x00\x00\x01\x01\x00\x00\x00", 10);   // too long for one
  for (const std::string& noise : {std::string("noise\xfd"), false_start, impossible, packet.substr(0, 15)}) {
    PacketParser parser;
    mavlink_message_t message;
    const std::string bytes = noise + packet + packet;
    const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
    TEST_ASSERT_EQUAL_UINT(bytes.size(), parser.feed(data, bytes.size(), 0));
    int found = 0;
    while (parser.next(message, 0)) ++found;
    TEST_ASSERT_EQUAL_INT(2, found);
    TEST_ASSERT_EQUAL_UINT(noise.size(), parser.bad_byte_count());
  }
}

// What began like a packet and stays unfinished gives way to what stood behind it.
void an_unfinished_packet_does_not_hold_up_the_next_for_long() {
  MavlinkHost host;
  const std::string start = std::string("\xfd\x21\x00\x00\x00\x01\x01\x4c\x00\x00", 10);  // a COMMAND_LONG of 33 bytes
  const std::string bytes = start + host.heartbeat();
  PacketParser parser;
  mavlink_message_t message;
  parser.feed(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), 0);
  TEST_ASSERT_FALSE(parser.next(message, 99999));
  TEST_ASSERT_TRUE(parser.next(message, 100000));
  TEST_ASSERT_EQUAL_UINT32(MAVLINK_MSG_ID_HEARTBEAT, message.msgid);
}

// `make fuzz` feeds a hundred times as many, with the compiler's checks of addresses and undefined behaviour.
void a_million_random_and_damaged_bytes_move_nothing() {
  LinkFuzz fuzz(1);
  TEST_ASSERT_TRUE(fuzz.run(1000000));
  TEST_ASSERT_TRUE(fuzz.fed() >= 1000000);
}

int main() {
  UNITY_BEGIN();
  RUN_TEST(messages_come_at_their_intervals_without_drift);
  RUN_TEST(a_car_without_an_imu_sends_no_attitude);
  RUN_TEST(the_parameter_list_is_that_of_the_table);
  RUN_TEST(the_parameter_list_is_complete_over_a_link_that_drops_a_fifth_of_the_bytes);
  RUN_TEST(a_parameter_is_set_or_the_value_that_holds_comes_back_with_the_reason);
  RUN_TEST(one_parameter_is_read_by_index_or_by_name);
  RUN_TEST(a_trial_goes_from_arming_to_its_end_by_commands);
  RUN_TEST(every_enum_of_the_firmware_has_the_dialects_values);
  RUN_TEST(a_repeated_command_is_answered_again_and_not_obeyed_twice);
  RUN_TEST(what_the_car_does_not_know_is_unsupported_and_what_is_for_others_is_left_alone);
  RUN_TEST(messages_can_be_asked_for_and_their_intervals_set);
  RUN_TEST(pulses_are_off_within_half_a_second_of_link_loss_a_thousand_times);
  RUN_TEST(only_the_host_that_drives_keeps_a_trial_alive);
  RUN_TEST(the_stick_drives_and_its_silence_stops);
  RUN_TEST(a_single_packet_sets_nothing_in_motion);
  RUN_TEST(an_output_is_tested_by_the_standard_command);
  RUN_TEST(clocks_are_compared_and_pings_answered);
  RUN_TEST(an_untethered_trial_is_recorded_and_can_be_fetched);
  RUN_TEST(the_newest_logs_are_kept_and_all_can_be_erased);
  RUN_TEST(the_longest_trial_fits_its_log);
  RUN_TEST(a_link_that_takes_little_gets_whole_packets_and_answers_first);
  RUN_TEST(a_refused_design_is_told_in_full_and_other_designs_by_name);
  RUN_TEST(the_board_restarts_on_request_but_not_while_it_drives);
  RUN_TEST(after_set_up_nothing_is_taken_from_the_heap);
  RUN_TEST(packets_are_found_among_noise_and_behind_false_starts);
  RUN_TEST(an_unfinished_packet_does_not_hold_up_the_next_for_long);
  RUN_TEST(a_million_random_and_damaged_bytes_move_nothing);
  return UNITY_END();
}
