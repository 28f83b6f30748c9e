// The queue of packets to send: numbers them and keeps their bytes until the link takes them. A packet for which there is no
// room is left out as a whole.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal.h"
#include "mavlink_packets.h"

namespace foldcar {

constexpr std::uint8_t kCarSystem = 1;
constexpr std::uint8_t kCarComponent = MAV_COMP_ID_AUTOPILOT1;
// The component that foldcar's own messages come from. Each component numbers its packets: a ground station does not see the
// numbers of messages that it does not know, and would count them as lost packets of the car's component.
constexpr std::uint8_t kOwnComponent = MAV_COMP_ID_USER2;

// The states of MAVLink's packet numbering, one for each component.
struct PacketNumbers {
  mavlink_status_t car{};
  mavlink_status_t own{};
};

// Telemetry, which is repeated, leaves room for answers, which are not.
enum class Priority : std::uint8_t { kTelemetry, kAnswer };

class Outbox {
 public:
  // content: one of MAVLink's generated structs; encode: its mavlink_msg_…_encode_status. Returns false if left out.
  template <typename Content, typename Encode>
  bool send(Encode encode, const Content& content, Priority priority) {
    mavlink_message_t message;
    encode(kCarSystem, kCarComponent, &numbers_.car, &message, &content);
    return send(message, priority);
  }
  bool send(const mavlink_message_t& message, Priority priority);

  // Whether packet_count more answers of any length have room.
  bool has_room_for(std::size_t packet_count) const;

  // Writes to the link what it takes without waiting.
  void flush(ByteLink& link);

  // What encode functions number packets with.
  PacketNumbers& numbers() { return numbers_; }
  // Packets left out so far.
  std::uint32_t unsent_count() const { return unsent_count_; }

 private:
  std::size_t room() const { return bytes_.size() - size_; }

  std::array<std::uint8_t, 4096> bytes_{};  // a ring buffer
  std::size_t first_ = 0;
  std::size_t size_ = 0;
  PacketNumbers numbers_;
  std::uint32_t unsent_count_ = 0;
};

}  // namespace foldcar
