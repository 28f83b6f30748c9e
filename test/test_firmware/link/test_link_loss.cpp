// What sets wheels in motion and what stops them: link loss, manual control, unknown hosts, input that waited, hostile bytes.
#include "../../suite.h"

#include <random>

#include "link_bench.h"

using namespace foldcar;

// In each of a thousand trials the host falls silent at a random time, between ticks too.
TEST(pulses_are_off_within_half_a_second_of_link_loss_a_thousand_times) {
  std::mt19937_64 random(2);
  std::uniform_int_distribution<std::uint64_t> any_us(0, 3000000);
  for (int trial = 0; trial < 1000; ++trial) {
    LinkBench bench;
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
  LinkBench bench;
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
  LinkBench bench;
  bench.run(100, bench.host.stick(500));
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.run(100, bench.host.stick(500));
  TEST_ASSERT_TRUE(bench.state() == State::kManual);
  for (int i = 0; i < 10; ++i) bench.run(100, bench.host.stick(500));
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1500.0f + 45.0f + 77.5f, bench.last_us()[0]);
  for (int i = 0; i < 10; ++i) bench.run(100, bench.host.stick(0, 1000));  // left wheels forward, right ones backward
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1700.0f, bench.last_us()[0]);
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1700.0f, bench.last_us()[1]);
  for (int i = 0; i < 10; ++i) bench.run(100, bench.host.stick(INT16_MAX));  // "axis is invalid"
  TEST_ASSERT_EQUAL_FLOAT(1500.0f, bench.last_us()[0]);
  bench.run(500);
  TEST_ASSERT_TRUE(bench.state() == State::kFault);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
}

// A ground station whose joystick was pulled out still sends its heartbeats, and asks for parameters.
TEST(only_the_stick_keeps_manual_driving_alive) {
  LinkBench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.run(20, bench.host.stick(1000));
  TEST_ASSERT_TRUE(bench.state() == State::kManual);
  for (int i = 0; i < 4; ++i) bench.run(100, bench.host.heartbeat() + bench.host.request_list());
  TEST_ASSERT_TRUE(bench.state() == State::kManual);
  bench.run(100, bench.host.heartbeat());
  TEST_ASSERT_TRUE(bench.fault() == Fault::kCommandStale);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
}

TEST(a_single_packet_sets_nothing_in_motion) {
  LinkBench bench;
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

// The host's bytes arrive while the loop stands still for time_ms; then it comes round again.
static void stand_still(LinkBench& bench, std::uint64_t time_ms, const std::string& bytes) {
  bench.board.link.incoming += bytes;
  bench.board.clock.time_us += 1000 * time_ms;
  bench.run(20);
}

// A write to flash, of up to 250 ms, makes nothing late.
TEST(a_start_that_waited_is_refused_and_one_that_did_not_is_executed) {
  LinkBench bench;
  const std::string start = bench.host.heartbeat() + bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  stand_still(bench, 250, start);
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
  bench.answer(MAV_CMD_FOLDCAR_STOP_TRIAL, {});
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  stand_still(bench, 600, start);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, bench.host.acks().back().result);
  TEST_ASSERT_TRUE(bench.last_refusal() == Refusal::kLate);
  TEST_ASSERT_EQUAL_STRING("refused: it waited while the car stood still", bench.last_text().c_str());
  TEST_ASSERT_TRUE(bench.state() == State::kArmed);
  // Its repetition is a new command.
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart, 1).result);
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
}

TEST(a_late_stick_and_late_signs_of_life_count_for_nothing) {
  LinkBench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  std::string bytes = bench.host.heartbeat() + bench.host.heartbeat();
  for (int i = 0; i < 200; ++i) bytes += bench.host.stick(500);
  stand_still(bench, 5100, bytes);
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  bench.run(20, bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  bench.run(2100);
  bench.run(20, bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, kStart));
  TEST_ASSERT_TRUE(bench.last_refusal() == Refusal::kUnknownHost);
}

TEST(a_late_setting_is_answered_and_not_obeyed) {
  LinkBench bench;
  bench.run(20, bench.host.heartbeat());
  stand_still(bench, 600, bench.host.set_parameter("TRACK_M", 0.2f));
  TEST_ASSERT_EQUAL_UINT(1, bench.host.parameters().size());
  TEST_ASSERT_EQUAL_FLOAT(0.111f, bench.host.parameters()[0].param_value);
  TEST_ASSERT_EQUAL_STRING("TRACK_M is not set: it waited while the car stood still", bench.last_text().c_str());
}

TEST(a_late_stop_and_a_late_disarm_are_executed) {
  LinkBench bench;
  bench.start(kStartUntethered);
  stand_still(bench, 600, bench.host.command(MAV_CMD_FOLDCAR_STOP_TRIAL, {}));
  TEST_ASSERT_TRUE(bench.state() == State::kFinished);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  stand_still(bench, 600, bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {0}));
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
}

// A stopped simulation does not know by its own clock that it was stopped.
TEST(a_caller_that_knows_of_a_pause_says_so) {
  LinkBench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.board.link.incoming = bench.host.heartbeat() + bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  bench.firmware.stood_still();
  bench.run(20);
  TEST_ASSERT_TRUE(bench.last_refusal() == Refusal::kLate);
  TEST_ASSERT_TRUE(bench.state() == State::kArmed);
}

TEST(what_arrived_while_the_board_started_is_forgotten) {
  RecordingHal board;
  board.link.room = 100000;
  MavlinkHost host;
  board.link.incoming = host.heartbeat() + host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  Firmware firmware{board.hal(), kBuild};
  firmware.begin({});
  firmware.poll();
  TEST_ASSERT_TRUE(firmware.application().status().state == State::kDisarmed);
}

namespace {

// Random and damaged bytes for the firmware's MAVLink connection.
class HostileBytes {
 public:
  explicit HostileBytes(std::uint64_t seed) : random_(seed) {}

  std::size_t below(std::size_t limit) { return static_cast<std::size_t>(random_() % limit); }

  std::string noise() {
    std::string bytes;
    for (std::size_t size = 1 + below(300); size > 0; --size) bytes += static_cast<char>(below(256));
    if (below(2) == 0) bytes[0] = static_cast<char>(MAVLINK_STX);
    return bytes;
  }

  // The packet with bytes changed, removed or inserted, or cut off; it never contains the whole packet.
  std::string damaged(const std::string& packet) {
    std::string bytes = packet;
    while (bytes.find(packet) != std::string::npos) {
      for (std::size_t count = 1 + below(4); count > 0 && !bytes.empty(); --count) {
        const std::size_t at = below(bytes.size());
        switch (below(4)) {
          case 0: bytes[at] = static_cast<char>(below(256)); break;
          case 1: bytes.erase(at, 1); break;
          case 2: bytes.insert(at, 1, static_cast<char>(below(256))); break;
          default: bytes.resize(at); break;
        }
      }
    }
    return bytes;
  }

 private:
  std::mt19937_64 random_;
};

std::vector<std::string> harmless_packets(MavlinkHost& host) {
  mavlink_param_request_read_t read{};
  read.target_system = 1;
  read.param_index = 7;
  return {host.heartbeat(), host.request_list(), host.set_parameter("TRACK_M", 0.2f),
          host.command(MAV_CMD_SET_MESSAGE_INTERVAL, {30, 20000}), host.command(MAV_CMD_REQUEST_MESSAGE, {148}),
          host.request_log_list(), host.request_log_data(1),
          host.pack(mavlink_msg_param_request_read_encode_status, read),
          host.pack(mavlink_msg_timesync_encode_status, mavlink_timesync_t{}),
          host.pack(mavlink_msg_ping_encode_status, mavlink_ping_t{})};
}

}  // namespace

// An armed car hears noise and damaged packets that request no motion; a disarmed one also those that arm and start.
// `make fuzz` looks for such bytes by coverage, under sanitizers.
TEST(a_million_random_and_damaged_bytes_move_nothing) {
  HostileBytes bytes(1);
  for (int session = 0; session < 6; ++session) {
    const bool armed = session % 2 == 0;
    LinkBench bench;
    bench.board.fit_imu();
    std::vector<std::string> packets = harmless_packets(bench.host);
    if (armed) {
      bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
    } else {
      packets.insert(packets.end(), {bench.host.stick(1000), bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}),
                                     bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.5f, 0, 10, 1, 1}),
                                     bench.host.command(MAV_CMD_ACTUATOR_TEST, {1, 3, 0, 0, 33})});
    }
    std::uint64_t next_heartbeat_us = 0;
    for (std::size_t fed = 0; fed < 170000; fed += bench.board.link.incoming.size(), bench.firmware.poll()) {
      // An armed car that is left alone disarms.
      if (armed && bench.board.clock.time_us >= next_heartbeat_us) {
        next_heartbeat_us = bench.board.clock.time_us + 1000000;
        bench.board.link.incoming = bench.host.heartbeat();
        bench.firmware.poll();
      }
      for (const PulsesUs& pulses_us : bench.board.servos.writes) TEST_ASSERT_TRUE(pulses_us == kOff);
      bench.board.servos.writes.clear();
      bench.board.link.outgoing.clear();
      bench.board.link.incoming = bytes.below(4) == 0 ? bytes.noise() : bytes.damaged(packets[bytes.below(packets.size())]);
      bench.board.clock.time_us += 1 + bytes.below(10000);
    }
    TEST_ASSERT_TRUE(bench.firmware.application().is_armed() == armed);
  }
}
