// Records untethered trials in the HAL's log storage, as a .tlog whose time counts from the start of the board.
//
// Input: the car's state. Rate: each tick. docs/link.md describes the format.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "car_messages.h"
#include "hal.h"
#include "outbox.h"
#include "status_text.h"

namespace foldcar {

// The number of logs that are kept, and the largest size (bytes) of one.
constexpr std::uint16_t kLogsKept = 4;
constexpr std::size_t kLargestLog = 256 * 1024;

class TrialLog {
 public:
  TrialLog(LogStorage& storage, StatusText& status_text) : storage_(storage), status_text_(status_text) {}

  // now_us: time since start (µs).
  void run(std::uint64_t now_us, const CarView& car);

 private:
  void open(const CarView& car);
  void close(const CarView& car);
  void record(std::uint32_t message_id, const CarView& car);
  void append_buffer();

  LogStorage& storage_;
  StatusText& status_text_;
  bool is_open_ = false;
  bool failed_ = false;
  std::uint64_t next_us_ = 0;
  std::size_t size_ = 0;
  PacketNumbers numbers_;
  std::array<std::uint8_t, 768> buffer_{};
  std::size_t buffered_ = 0;
};

}  // namespace foldcar
