// Finds MAVLink packets in a stream of bytes, any of which may be missing or wrong.
//
// Input: bytes as they arrive. Output: complete packets of known messages whose checksum is correct; those of MAVLink 1 too,
// so that their host can be told. After a false start the
// search continues at the next byte, so that no packet behind it is lost. No heap; many parsers may exist.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "mavlink_packets.h"

namespace foldcar {

class PacketParser {
 public:
  // Takes as many of size bytes as there is room for and returns their number; then call next() until it returns false.
  // now_us: time since start (µs).
  std::size_t feed(const std::uint8_t* data, std::size_t size, std::uint64_t now_us);

  // The next packet, its payload padded with zeros. Returns false if more bytes are needed.
  bool next(mavlink_message_t& message, std::uint64_t now_us);

  // Packets found so far.
  std::uint32_t packet_count() const { return packet_count_; }
  // Bytes so far that belong to no packet.
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
