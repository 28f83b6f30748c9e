#include "outbox.h"

#include <algorithm>

namespace foldcar {
namespace {

constexpr std::size_t kReserveForAnswers = 1536;  // bytes that telemetry leaves free

}  // namespace

// Appends a packet to the ring buffer. If there is no room, it is dropped and counted, and false returned.
bool Outbox::send(const mavlink_message_t& message, Priority priority) {
  std::uint8_t packet[MAVLINK_MAX_PACKET_LEN];
  const std::size_t size = mavlink_msg_to_send_buffer(packet, &message);
  const std::size_t reserve = priority == Priority::kTelemetry ? kReserveForAnswers : 0;
  if (size + reserve > room()) {
    ++unsent_count_;
    return false;
  }
  for (std::size_t i = 0; i < size; ++i) bytes_[(first_ + size_ + i) % bytes_.size()] = packet[i];
  size_ += size;
  return true;
}

bool Outbox::has_room_for(std::size_t packet_count) const {
  return room() >= packet_count * MAVLINK_MAX_PACKET_LEN;
}

// Writes what the link takes without waiting; the rest stays in the ring buffer.
void Outbox::flush(ByteLink& link) {
  while (size_ > 0) {
    const std::size_t contiguous = std::min(size_, bytes_.size() - first_);
    const std::size_t written = link.write(bytes_.data() + first_, contiguous);
    first_ = (first_ + written) % bytes_.size();
    size_ -= written;
    if (written < contiguous) return;
  }
}

}  // namespace foldcar
