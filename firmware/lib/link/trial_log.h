// Records untethered trials in the HAL's log storage, as a .tlog whose time counts from the start of the board.
//
// Input: the car's state. Rate: run() each tick; store() in another task. docs/link.md describes the format.
#pragma once

#include <cstddef>
#include <cstdint>

#include "car_messages.h"
#include "hal.h"
#include "log_writer.h"
#include "outbox.h"
#include "status_text.h"

namespace foldcar {

class TrialLog {
 public:
  TrialLog(LogStorage& storage, StatusText& status_text) : writer_(storage), status_text_(status_text) {}

  // now_us: time since start (µs).
  void run(std::uint64_t now_us, const CarView& car);
  // As LogWriter::work().
  bool store() { return writer_.work(); }

  // Whether no log is being recorded or stored and flash is ready for the next: only then may others use the storage, and may
  // wheels start.
  bool is_idle() const { return writer_.is_idle(); }
  LogStatus status() const { return writer_.status(); }

 private:
  void open(std::uint64_t now_us, const CarView& car);
  void close(const CarView& car);
  void report();
  // reserve: bytes that the log keeps free behind the record.
  void record(std::uint32_t message_id, const CarView& car, std::size_t reserve);

  LogWriter writer_;
  StatusText& status_text_;
  bool is_recording_ = false;
  bool is_unreported_ = false;  // a log was closed, and nothing was said about it yet
  std::uint64_t period_us_ = 0, next_us_ = 0;
  PacketNumbers numbers_;  // of the log's packets
};

}  // namespace foldcar
