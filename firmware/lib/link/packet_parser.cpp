#include "packet_parser.h"

#include <algorithm>
#include <cstring>

namespace foldcar {
namespace {

constexpr std::size_t kHeaderSize = 10;
constexpr std::size_t kChecksumSize = 2;
// The bytes of a packet come without a pause: one that is incomplete after this time (µs) is a false start.
constexpr std::uint64_t kPauseUs = 100000;

std::uint32_t message_id(const std::uint8_t* packet) {
  return packet[7] | (static_cast<std::uint32_t>(packet[8]) << 8) | (static_cast<std::uint32_t>(packet[9]) << 16);
}

// The message whose header this can be; null if there is none.
const mavlink_msg_entry_t* message_entry(const std::uint8_t* packet) {
  const bool is_signed_or_new = packet[2] != 0;
  if (is_signed_or_new) return nullptr;
  const mavlink_msg_entry_t* entry = mavlink_get_msg_entry(message_id(packet));
  return entry != nullptr && packet[1] <= entry->max_msg_len ? entry : nullptr;
}

bool checksum_is_right(const std::uint8_t* packet, const mavlink_msg_entry_t& entry) {
  const std::size_t end = kHeaderSize + packet[1];
  std::uint16_t checksum = crc_calculate(packet + 1, static_cast<std::uint16_t>(end - 1));
  crc_accumulate(entry.crc_extra, &checksum);
  return packet[end] == (checksum & 0xFF) && packet[end + 1] == (checksum >> 8);
}

void copy_packet(const std::uint8_t* packet, mavlink_message_t& message) {
  message = mavlink_message_t{};
  message.magic = packet[0];
  message.len = packet[1];
  message.compat_flags = packet[3];
  message.seq = packet[4];
  message.sysid = packet[5];
  message.compid = packet[6];
  message.msgid = message_id(packet);
  std::memcpy(_MAV_PAYLOAD_NON_CONST(&message), packet + kHeaderSize, packet[1]);
}

}  // namespace

std::size_t PacketParser::feed(const std::uint8_t* data, std::size_t size, std::uint64_t now_us) {
  const std::size_t count = std::min(size, bytes_.size() - size_);
  std::copy_n(data, count, bytes_.begin() + static_cast<std::ptrdiff_t>(size_));
  size_ += count;
  if (count > 0) fed_us_ = now_us;
  return count;
}

bool PacketParser::next(mavlink_message_t& message, std::uint64_t now_us) {
  for (;;) {
    drop_noise();
    const mavlink_msg_entry_t* entry = size_ >= kHeaderSize ? message_entry(bytes_.data()) : nullptr;
    const std::size_t whole = entry != nullptr ? kHeaderSize + bytes_[1] + kChecksumSize : kHeaderSize;
    if (size_ < whole) {
      if (size_ == 0 || now_us - fed_us_ < kPauseUs) return false;
    } else if (entry != nullptr && checksum_is_right(bytes_.data(), *entry)) {
      copy_packet(bytes_.data(), message);
      drop(whole);
      ++packet_count_;
      return true;
    }
    drop(1);
    ++bad_byte_count_;
  }
}

void PacketParser::drop(std::size_t count) {
  std::copy(bytes_.begin() + static_cast<std::ptrdiff_t>(count), bytes_.begin() + static_cast<std::ptrdiff_t>(size_),
            bytes_.begin());
  size_ -= count;
}

// Drops the bytes before the next one that can start a packet.
void PacketParser::drop_noise() {
  const auto end = bytes_.begin() + static_cast<std::ptrdiff_t>(size_);
  const auto noise = static_cast<std::size_t>(std::find(bytes_.begin(), end, MAVLINK_STX) - bytes_.begin());
  if (noise == 0) return;
  drop(noise);
  bad_byte_count_ += static_cast<std::uint32_t>(noise);
}

}  // namespace foldcar
