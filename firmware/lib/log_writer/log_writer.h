// Stores a trial's log in flash from another task than the one that drives the car.
//
// Writing and above all erasing flash takes 65 to 600 ms. So the tick only puts records into a ring in RAM, and a worker of
// low priority calls work() again and again. It leaves flash alone until kBlock bytes wait, which most trials never reach,
// and stores the rest when the trial is over. A record that does not fit, or cannot be stored, is counted.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "hal.h"
#include "log_ring.h"

namespace foldcar {

// The number of logs that are kept.
constexpr std::uint16_t kLogsKept = 4;

// The values are those of FOLDCAR_LOG in the MAVLink dialect.
enum class LogState : std::uint8_t {
  kNone,       // there was no log since the start
  kOpen,       // it is recorded, or not all of it is in flash
  kStored,     // closed, and complete
  kIncomplete  // closed; lost_bytes are missing
};

struct LogStatus {
  LogState state = LogState::kNone;
  std::uint32_t lost_bytes = 0;
};

class LogWriter {
 public:
  // While a trial runs, flash is written when so many bytes wait: 27 s of records with an IMU, 44 s without.
  static constexpr std::size_t kBlock = LogRing::kSize / 2;

  explicit LogWriter(LogStorage& storage) : storage_(storage) {}

  // The tick's side. No call waits.
  // Whether no log is being recorded or stored: only then may others use the storage.
  bool is_idle() const { return phase_.load(std::memory_order_acquire) == Phase::kIdle; }
  // Begins a log. Returns false if the last one is not stored yet.
  bool begin();
  // Adds a record as a whole. Returns false if it would not leave reserve bytes of RAM free behind it.
  bool put(const std::uint8_t* record, std::size_t size, std::size_t reserve) {
    return ring_.put(record, size, reserve);
  }
  // Counts a record of that size (bytes) which the log has not got.
  void lose(std::size_t size) { left_out_bytes_ += static_cast<std::uint32_t>(size); }
  // The log is complete; the worker stores and closes it.
  void finish() { phase_.store(Phase::kFinished, std::memory_order_release); }
  LogStatus status() const;

  // The worker's side: does one thing with the storage, which may take long. Returns whether there is more to do at once.
  bool work();

 private:
  enum class Phase : std::uint32_t { kIdle, kRecording, kFinished };

  bool open();
  bool close();
  void store();

  LogStorage& storage_;
  LogRing ring_;
  std::atomic<Phase> phase_{Phase::kIdle};
  std::atomic<std::uint32_t> unstored_bytes_{0};  // the storage did not take them
  // The tick's.
  bool has_begun_ = false;
  std::uint32_t left_out_bytes_ = 0;
  // The worker's.
  bool is_open_ = false;
  bool has_failed_ = false;
};

}  // namespace foldcar
