// Stores a trial's log in flash from another task than the one that drives the car.
//
// The tick puts records into a queue. A worker of low priority calls work() again and again: it programs the records into
// prepared flash, also while wheels turn, because a page stops both cores for 3 ms at most. Erasing stops them for up to
// 0.4 s, so flash is prepared for the next log before wheels may start. A record that does not fit, or cannot be stored, is
// counted.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "hal.h"

namespace foldcar {

// The values are those of FOLDCAR_LOG in the MAVLink dialect.
enum class LogState : std::uint8_t {
  kNone,       // there was no log since the start; flash is ready for one
  kOpen,       // it is recorded, or flash is not ready for the next one, as just after the start
  kStored,     // closed, and complete
  kIncomplete  // closed; lost_bytes are missing
};

struct LogStatus {
  LogState state = LogState::kNone;
  std::uint32_t lost_bytes = 0;
};

class LogWriter {
 public:
  // Bytes of the queue: what a trial records in 4 s.
  static constexpr std::size_t kQueueSize = 8 * 1024;
  // Bytes stored at once, less than a page of flash.
  static constexpr std::size_t kSlice = 240;

  explicit LogWriter(LogStorage& storage) : storage_(storage) {}

  // The tick's side. No call waits.
  // Whether no log is being recorded or stored and flash is ready for the next: only then may others use the storage.
  bool is_idle() const { return phase_.load(std::memory_order_acquire) == Phase::kIdle; }
  // Begins a log. Returns false unless the writer is idle.
  bool begin();
  // Adds a record as a whole. Returns false if it would not leave reserve bytes of the queue and of the log free behind it.
  bool put(const std::uint8_t* record, std::size_t size, std::size_t reserve);
  // Counts a record of that size (bytes) which the log has not got.
  void lose(std::size_t size) { left_out_bytes_ += static_cast<std::uint32_t>(size); }
  // The log is complete; the worker stores the rest and closes it.
  void finish() { phase_.store(Phase::kFinished, std::memory_order_release); }
  LogStatus status() const;

  // The worker's side: does one thing with the storage, which may take long. Returns whether there is more to do at once.
  bool work();

 private:
  enum class Phase : std::uint32_t { kPreparing, kIdle, kRecording, kFinished };

  bool prepare();
  void open();
  bool store(bool is_finished);
  void close();

  LogStorage& storage_;
  std::atomic<Phase> phase_{Phase::kPreparing};
  // Bytes of the log that were put into the queue and taken from it; a byte's place in the queue is its number modulo its size.
  std::array<std::uint8_t, kQueueSize> queue_;
  std::atomic<std::uint32_t> put_bytes_{0};    // written by the tick
  std::atomic<std::uint32_t> taken_bytes_{0};  // written by the worker
  std::atomic<std::uint32_t> unstored_bytes_{0};  // taken, but not in the storage
  // The tick's.
  bool has_begun_ = false;
  std::uint32_t left_out_bytes_ = 0;
  // The worker's.
  bool is_open_ = false;
  bool has_failed_ = false;
  std::uint16_t id_ = 0;  // of the log
};

}  // namespace foldcar
