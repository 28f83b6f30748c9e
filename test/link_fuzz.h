// Random and damaged bytes for the firmware's MAVLink connection. None of them may set wheels in motion.
//
// Half of the sessions feed a disarmed car with noise and damaged packets of every kind, those that arm and start
// included; the other half feed an armed car with noise and damaged packets that request no motion.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "firmware.h"
#include "mavlink_host.h"
#include "recording_hal.h"

namespace foldcar {

class LinkFuzz {
 public:
  explicit LinkFuzz(std::uint64_t seed) : random_(seed) {}

  // Feeds byte_count bytes. Returns false as soon as a pulse is written, or an armed car is not armed any more.
  bool run(std::uint64_t byte_count) {
    while (fed_ < byte_count) {
      if (!session(sessions_++ % 2 == 0)) return false;
    }
    return true;
  }
  std::uint64_t fed() const { return fed_; }
  std::uint64_t accepted_count() const { return accepted_count_; }

 private:
  static constexpr std::size_t kSessionBytes = 200000;

  bool session(bool armed) {
    RecordingHal board;
    board.fit_imu();
    board.link.room = 100000;
    Firmware firmware(board.hal(), "0123456789abcdef");
    firmware.begin({});
    MavlinkHost host;
    if (armed) {
      board.link.incoming = host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1});
      firmware.poll();
    }
    const std::vector<std::string> packets = sound_packets(host, armed);
    std::uint64_t next_heartbeat_us = 0;
    for (std::size_t fed = 0; fed < kSessionBytes;) {
      // An armed car that is left alone disarms.
      if (armed && board.clock.time_us >= next_heartbeat_us) {
        next_heartbeat_us += 1000000;
        board.link.incoming = host.heartbeat();
        firmware.poll();
      }
      board.link.incoming = below(4) == 0 ? noise() : damaged(packets[below(packets.size())]);
      fed += board.link.incoming.size();
      fed_ += board.link.incoming.size();
      board.clock.time_us += 1 + below(10000);
      firmware.poll();
      for (const PulsesUs& pulses_us : board.servos.writes) {
        if (pulses_us != PulsesUs{}) return false;
      }
      board.servos.writes.clear();
      count_answers(board.link.outgoing);
      board.link.outgoing.clear();
    }
    return firmware.application().is_armed() == armed;
  }

  static std::vector<std::string> sound_packets(MavlinkHost& host, bool armed) {
    mavlink_log_request_data_t data{};
    data.target_system = 1;
    data.count = 1000;
    mavlink_param_request_read_t read{};
    read.target_system = 1;
    read.param_index = 7;
    std::vector<std::string> packets = {
        host.heartbeat(), host.request_list(), host.set_parameter("TRACK_M", 0.2f),
        host.command(MAV_CMD_SET_MESSAGE_INTERVAL, {30, 20000}), host.command(MAV_CMD_REQUEST_MESSAGE, {148}),
        host.pack(mavlink_msg_log_request_data_encode_status, data),
        host.pack(mavlink_msg_param_request_read_encode_status, read),
        host.pack(mavlink_msg_timesync_encode_status, mavlink_timesync_t{}),
        host.pack(mavlink_msg_ping_encode_status, mavlink_ping_t{}),
        host.pack(mavlink_msg_log_request_list_encode_status, mavlink_log_request_list_t{})};
    if (armed) return packets;
    packets.insert(packets.end(), {host.stick(1000), host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}),
                                   host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.5f, 0, 10, 1, 1}),
                                   host.command(MAV_CMD_ACTUATOR_TEST, {1, 3, 0, 0, 33})});
    return packets;
  }

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

  // Counts the answers of the car, which show how many damaged packets it accepted.
  void count_answers(const std::string& bytes) {
    reader_.received.clear();
    reader_.receive(bytes);
    for (const mavlink_message_t& message : reader_.received) {
      const std::uint32_t id = message.msgid;
      if (id == MAVLINK_MSG_ID_COMMAND_ACK || id == MAVLINK_MSG_ID_PARAM_VALUE) ++accepted_count_;
    }
  }

  std::size_t below(std::size_t limit) { return static_cast<std::size_t>(random_() % limit); }

  std::mt19937_64 random_;
  std::uint64_t sessions_ = 0;
  std::uint64_t fed_ = 0;
  std::uint64_t accepted_count_ = 0;
  MavlinkHost reader_;
};

}  // namespace foldcar
