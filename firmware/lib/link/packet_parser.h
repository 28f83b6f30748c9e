// Finds MAVLink 2 packets in a stream of bytes, of which any may be missing or wrong.
//
// Input: bytes, as they arrive. Output: whole packets of known messages with a right checksum. What looks like a packet
// and is none costs only its first byte: the search goes on behind that. No heap; many parsers may exist.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "mavlink_packets.h"

namespace foldcar {

class PacketParser {
 public:
  // Takes as many bytes as there is room for and returns how many. Then next() until it is false.
  std::size_t feed(const std::uint8_t* data, std::size_t size, std::uint64_t now_us);

  // The next packet, its payload filled up with zeros. False if more bytes are needed.
  bool next(mavlink_message_t& message, std::uint64_t now_us);

  std::uint32_t packet_count() const { return packet_count_; }
  // Bytes that belonged to no packet.
  std::uint32_t bad_byte_count() const { return bad_byte_count_; }

 private:
  void drop(std::size_t count);
  void drop_noise();

  std::array<std::uint8_t, 2 * MAVLINK_MAX_PACKET_LEN> bytes_{};
  std::size_t size_ = 0;
  std::uint64_t fed_us_ = 0;
  std::uint32_t packet_count_ = 0;
  std::uint32_t bad_byte_count_ = 0;
};

}  // namespace foldcar
