// Packets on their way out: numbers them, keeps them until the link takes their bytes, leaves out whole packets when
// there is no room.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal.h"
#include "mavlink_packets.h"

namespace foldcar {

constexpr std::uint8_t kCarSystem = 1;
constexpr std::uint8_t kCarComponent = MAV_COMP_ID_AUTOPILOT1;

// Telemetry leaves room for answers, which nothing repeats.
enum class Priority : std::uint8_t { kTelemetry, kAnswer };

class Outbox {
 public:
  // content as one of the generated structs, encode as its mavlink_msg_…_encode_status. False if left out.
  template <typename Content, typename Encode>
  bool send(Encode encode, const Content& content, Priority priority) {
    mavlink_message_t message;
    encode(kCarSystem, kCarComponent, &numbering_, &message, &content);
    return send(message, priority);
  }
  bool send(const mavlink_message_t& message, Priority priority);

  // Room for that many more packets of any length, telemetry's reserve not counted.
  bool has_room_for(std::size_t packet_count) const;

  // Gives the link what it takes at once.
  void flush(ByteLink& link);

  mavlink_status_t& numbering() { return numbering_; }
  std::uint32_t unsent_count() const { return unsent_count_; }

 private:
  std::size_t room() const { return bytes_.size() - size_; }

  std::array<std::uint8_t, 4096> bytes_{};  // a ring
  std::size_t first_ = 0;
  std::size_t size_ = 0;
  mavlink_status_t numbering_{};
  std::uint32_t unsent_count_ = 0;
};

}  // namespace foldcar
