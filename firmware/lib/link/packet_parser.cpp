#include "packet_parser.h"

#include <algorithm>
#include <cstring>

namespace foldcar {
namespace {

constexpr std::size_t kHeaderSize = 10;
constexpr std::size_t kHeaderSize1 = 6;  // of MAVLink 1
constexpr std::size_t kChecksumSize = 2;
// The bytes of a packet come without a pause: one that is incomplete after this time (µs) is a false start.
constexpr std::uint64_t kPauseUs = 100000;

bool is_start(std::uint8_t byte) { return byte == MAVLINK_STX || byte == MAVLINK_STX_MAVLINK1; }

// A packet's header, of MAVLink 2 or 1, read from its first bytes. entry: MAVLink's description of the message; null
// if the message is unknown, signed or has an impossible length.
struct Header {
  std::size_t size;
  std::uint32_t message_id = 0;
  const mavlink_msg_entry_t* entry = nullptr;

  explicit Header(const std::uint8_t* packet) : size(packet[0] == MAVLINK_STX ? kHeaderSize : kHeaderSize1) {
    const bool is_new = size == kHeaderSize;
    const bool is_signed_or_newer = is_new && packet[2] != 0;
    if (is_signed_or_newer) return;
    message_id = is_new ? packet[7] | (static_cast<std::uint32_t>(packet[8]) << 8) |
                              (static_cast<std::uint32_t>(packet[9]) << 16)
                        : packet[5];
    entry = mavlink_get_msg_entry(message_id);
    if (entry == nullptr) return;
    // MAVLink 2 leaves zeros at the end away, MAVLink 1 the fields that were added later.
    const bool fits = is_new ? packet[1] <= entry->max_msg_len : packet[1] == entry->min_msg_len;
    if (!fits) entry = nullptr;
  }
};

bool checksum_is_right(const std::uint8_t* packet, const Header& header) {
  const std::size_t end = header.size + packet[1];
  std::uint16_t checksum = crc_calculate(packet + 1, static_cast<std::uint16_t>(end - 1));
  crc_accumulate(header.entry->crc_extra, &checksum);
  return packet[end] == (checksum & 0xFF) && packet[end + 1] == (checksum >> 8);
}

void copy_packet(const std::uint8_t* packet, const Header& header, mavlink_message_t& message) {
  const std::uint8_t* sender = packet + (header.size == kHeaderSize ? 4 : 2);
  message = mavlink_message_t{};
  message.magic = packet[0];
  message.len = packet[1];
  message.seq = sender[0];
  message.sysid = sender[1];
  message.compid = sender[2];
  message.msgid = header.message_id;
  std::memcpy(_MAV_PAYLOAD_NON_CONST(&message), packet + header.size, packet[1]);
}

}  // namespace

// Appends bytes as far as there is room; returns how many.
std::size_t PacketParser::feed(const std::uint8_t* data, std::size_t size, std::uint64_t now_us) {
  const std::size_t count = std::min(size, bytes_.size() - size_);
  std::copy_n(data, count, bytes_.begin() + static_cast<std::ptrdiff_t>(size_));
  size_ += count;
  if (count > 0) fed_us_ = now_us;
  return count;
}

// Takes the next packet with a right checksum from the bytes fed; false if none is complete yet. A start byte that
// does not begin such a packet is dropped, and the search goes on behind it.
bool PacketParser::next(mavlink_message_t& message, std::uint64_t now_us) {
  for (;;) {
    drop_noise();
    // What is behind the bytes that have arrived is ignored until enough have.
    const Header header(bytes_.data());
    const bool is_known = size_ >= header.size && header.entry != nullptr;
    const std::size_t whole = is_known ? header.size + bytes_[1] + kChecksumSize : header.size;
    if (size_ < whole) {
      if (size_ == 0 || now_us - fed_us_ < kPauseUs) return false;
    } else if (is_known && checksum_is_right(bytes_.data(), header)) {
      copy_packet(bytes_.data(), header, message);
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
  const auto noise = static_cast<std::size_t>(std::find_if(bytes_.begin(), end, is_start) - bytes_.begin());
  if (noise == 0) return;
  drop(noise);
  bad_byte_count_ += static_cast<std::uint32_t>(noise);
}

}  // namespace foldcar
