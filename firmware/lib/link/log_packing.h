// Keeps the messages of a trial's log small while they wait in RAM: of each, its kind, the time since the last one, and
// those bytes of its content in which it differs from the last of its kind.
//
// A packed message: kind (1 byte, its top bit set for foldcar's own component), time (µs, 7 bits in a byte, the lowest
// first, the top bit set on all but the last), one bit for each byte of the content, the differing bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "log_writer.h"
#include "outbox.h"

namespace foldcar {

// The messages of a log: first the car's design, then these, again and again.
constexpr std::array<std::uint32_t, 7> kLogged = {MAVLINK_MSG_ID_FOLDCAR_DESIGN,   MAVLINK_MSG_ID_FOLDCAR_TRIAL,
                                                  MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, MAVLINK_MSG_ID_SYS_STATUS,
                                                  MAVLINK_MSG_ID_ATTITUDE,         MAVLINK_MSG_ID_SCALED_IMU,
                                                  MAVLINK_MSG_ID_BATTERY_STATUS};

// The longest of their contents.
constexpr std::size_t kLargestContent = MAVLINK_MSG_ID_FOLDCAR_DESIGN_LEN;

// What the next message is compared with: the last time and contents.
struct LastLogged {
  std::uint64_t time_us = 0;
  std::array<std::array<std::uint8_t, kLargestContent>, kLogged.size()> contents{};
};

// The tick's side.
class LogPacker {
 public:
  // Begins a log.
  void begin() { last_ = {}; }
  // Packs one of kLogged, of that time (µs; at least the last one's), and returns the number of bytes. Only keep() makes
  // the message the last one: one that found no room is not.
  std::size_t pack(std::uint64_t time_us, const mavlink_message_t& message, std::uint8_t (&packed)[kLargestPacked]) const;
  void keep(std::uint64_t time_us, const mavlink_message_t& message);

 private:
  LastLogged last_;
};

// The worker's side: makes records of a .tlog from packed messages.
class LogUnpacker : public LogFormat {
 public:
  void begin() override;
  Unpacked unpack(const std::uint8_t* packed, std::uint8_t* record) override;

 private:
  LastLogged last_;
  PacketNumbers numbers_;
};

}  // namespace foldcar
