// A MAVLink host for tests: packs messages, and reads those of the car with MAVLink's reference parser.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "mavlink_packets.h"

namespace foldcar {

class MavlinkHost {
 public:
  explicit MavlinkHost(std::uint8_t system = 255, std::uint8_t component = 190)
      : system_(system), component_(component) {}

  // The packet of a message. content: one of MAVLink's generated structs; encode: its mavlink_msg_…_encode_status.
  template <typename Content, typename Encode>
  std::string pack(Encode encode, const Content& content) {
    mavlink_message_t message;
    encode(system_, component_, &numbering_, &message, &content);
    std::uint8_t bytes[MAVLINK_MAX_PACKET_LEN];
    const std::size_t size = mavlink_msg_to_send_buffer(bytes, &message);
    return {bytes, bytes + size};
  }

  // From now on packets are of the older format.
  void speak_mavlink_1() { numbering_.flags |= MAVLINK_STATUS_FLAG_OUT_MAVLINK1; }

  std::string heartbeat() {
    mavlink_heartbeat_t content{};
    content.type = MAV_TYPE_GCS;
    content.autopilot = MAV_AUTOPILOT_INVALID;
    return pack(mavlink_msg_heartbeat_encode_status, content);
  }

  std::string command(std::uint16_t command, std::vector<float> parameters, std::uint8_t confirmation = 0) {
    parameters.resize(7);
    auto content = to_car<mavlink_command_long_t>();
    std::memcpy(&content, parameters.data(), 7 * sizeof(float));  // its first seven members
    content.command = command;
    content.confirmation = confirmation;
    return pack(mavlink_msg_command_long_encode_status, content);
  }

  // Forward and to the right, of 1000; the other stick stands anywhere.
  std::string stick(std::int16_t forward, std::int16_t right = 0) {
    mavlink_manual_control_t content{};
    content.target = 1;
    content.x = forward;
    content.y = right;
    content.z = 500;
    content.r = -300;
    return pack(mavlink_msg_manual_control_encode_status, content);
  }

  // The scene in which a simulated car is to stand.
  std::string scene(const char* id) {
    mavlink_foldcar_scene_t content{};
    std::memcpy(content.id, id, std::min(std::strlen(id), sizeof content.id));
    return pack(mavlink_msg_foldcar_scene_encode_status, content);
  }

  std::string request_list() {
    return pack(mavlink_msg_param_request_list_encode_status, to_car<mavlink_param_request_list_t>());
  }

  std::string set_parameter(const char* name, float value) {
    auto content = to_car<mavlink_param_set_t>();
    std::memcpy(content.param_id, name, std::min(std::strlen(name), sizeof content.param_id));
    content.param_value = value;
    content.param_type = MAV_PARAM_TYPE_REAL32;
    return pack(mavlink_msg_param_set_encode_status, content);
  }

  std::string request_log_list() {
    auto content = to_car<mavlink_log_request_list_t>();
    content.end = 0xFFFF;
    return pack(mavlink_msg_log_request_list_encode_status, content);
  }

  // The whole log.
  std::string request_log_data(std::uint16_t id) {
    auto content = to_car<mavlink_log_request_data_t>();
    content.id = id;
    content.count = UINT32_MAX;
    return pack(mavlink_msg_log_request_data_encode_status, content);
  }

  std::string erase_logs() { return pack(mavlink_msg_log_erase_encode_status, to_car<mavlink_log_erase_t>()); }

  // Reads bytes of the car and keeps the messages in received.
  void receive(const std::string& bytes) {
    for (const char byte : bytes) {
      mavlink_message_t message;
      mavlink_status_t status;
      const std::uint8_t framing =
          mavlink_frame_char_buffer(&buffer_, &parsing_, static_cast<std::uint8_t>(byte), &message, &status);
      if (framing == MAVLINK_FRAMING_OK) received.push_back(message);
      if (framing == MAVLINK_FRAMING_BAD_CRC) ++bad_count;
    }
  }

  // Reads a log's records, each a time (us, 8 bytes) and a packet; returns whether they are whole and in order of time.
  bool receive_log(const std::string& log) {
    std::uint64_t last_us = 0;
    for (std::size_t at = 0; at < log.size();) {
      if (at + 20 > log.size()) return false;
      std::uint64_t t_us = 0;
      for (std::size_t i = 0; i < 8; ++i) t_us = (t_us << 8) | static_cast<std::uint8_t>(log[at + i]);
      if (t_us < last_us) return false;
      last_us = t_us;
      const std::size_t size = 12 + static_cast<std::uint8_t>(log[at + 9]);
      receive(log.substr(at + 8, size));
      at += 8 + size;
    }
    return bad_count == 0;
  }

  // The messages of one kind, decoded.
  template <typename Content, typename Decode>
  std::vector<Content> all(std::uint32_t message_id, Decode decode) const {
    std::vector<Content> contents;
    for (const mavlink_message_t& message : received) {
      if (message.msgid != message_id) continue;
      contents.emplace_back();
      decode(&message, &contents.back());
    }
    return contents;
  }

  std::vector<mavlink_command_ack_t> acks() const {
    return all<mavlink_command_ack_t>(MAVLINK_MSG_ID_COMMAND_ACK, mavlink_msg_command_ack_decode);
  }
  std::vector<mavlink_param_value_t> parameters() const {
    return all<mavlink_param_value_t>(MAVLINK_MSG_ID_PARAM_VALUE, mavlink_msg_param_value_decode);
  }
  std::vector<mavlink_foldcar_trial_t> trials() const {
    return all<mavlink_foldcar_trial_t>(MAVLINK_MSG_ID_FOLDCAR_TRIAL, mavlink_msg_foldcar_trial_decode);
  }
  // The lines for people, joined from their parts.
  std::vector<std::string> texts() const {
    std::vector<std::string> lines;
    for (const auto& part : all<mavlink_statustext_t>(MAVLINK_MSG_ID_STATUSTEXT, mavlink_msg_statustext_decode)) {
      const std::string text(part.text, strnlen(part.text, sizeof part.text));
      if (part.chunk_seq == 0) {
        lines.push_back(text);
      } else {
        lines.back() += text;
      }
    }
    return lines;
  }

  bool said(const std::string& line) const {
    const std::vector<std::string> lines = texts();
    return std::find(lines.begin(), lines.end(), line) != lines.end();
  }

  std::vector<mavlink_message_t> received;
  int bad_count = 0;

 private:
  template <typename Content>
  static Content to_car() {
    Content content{};
    content.target_system = content.target_component = 1;
    return content;
  }

  std::uint8_t system_;
  std::uint8_t component_;
  mavlink_status_t numbering_{};
  mavlink_status_t parsing_{};
  mavlink_message_t buffer_{};
};

}  // namespace foldcar
