// Stores a trial's log in flash from another task than the one that drives the car.
//
// Writing and above all erasing flash takes 65 to 600 ms. So the tick only puts records into RAM, and a worker of
// low priority calls work() again and again, which leaves flash alone until the log is complete. Wheels stand then, and do
// not start before all is stored. A record that does not fit, or cannot be stored, is counted.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "hal.h"

namespace foldcar {

// The number of logs that are kept.
constexpr std::uint16_t kLogsKept = 4;

// Bytes of the largest record, and of the largest packed one.
constexpr std::size_t kLargestRecord = 96;
constexpr std::size_t kLargestPacked = 96;

// Makes the records of a log from packed ones, in their order.
class LogFormat {
 public:
  virtual ~LogFormat() = default;
  // Begins a log.
  virtual void begin() = 0;
  // Bytes of a packed record, and of the record itself.
  struct Unpacked {
    std::size_t packed_size, size;
  };
  // packed: one packed record, and whatever is behind it; record: room for kLargestRecord bytes.
  virtual Unpacked unpack(const std::uint8_t* packed, std::uint8_t* record) = 0;
};

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
  // Bytes of packed records: what the board's static memory has room for.
  static constexpr std::size_t kSize = 72 * 1024;
  // Bytes stored at once.
  static constexpr std::size_t kSlice = 4096;

  LogWriter(LogStorage& storage, LogFormat& format) : storage_(storage), format_(format) {}

  // The tick's side. No call waits.
  // Whether no log is being recorded or stored: only then may others use the storage.
  bool is_idle() const { return phase_.load(std::memory_order_acquire) == Phase::kIdle; }
  // Begins a log. Returns false if the last one is not stored yet.
  bool begin();
  // Adds a packed record as a whole. Returns false if it would not leave reserve bytes of RAM free behind it.
  bool put(const std::uint8_t* packed, std::size_t size, std::size_t reserve) {
    if (size + reserve > kSize - put_bytes_) return false;
    std::copy_n(packed, size, packed_.begin() + static_cast<std::ptrdiff_t>(put_bytes_));
    put_bytes_ += size;
    return true;
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

  void open();
  void store();
  bool close();

  LogStorage& storage_;
  LogFormat& format_;
  std::atomic<Phase> phase_{Phase::kIdle};
  // The tick's until the log is finished, then the worker's.
  std::array<std::uint8_t, kSize> packed_;  // what is in it is set when it is put
  std::size_t put_bytes_ = 0;
  std::atomic<std::uint32_t> unstored_bytes_{0};  // the storage did not take them
  // The tick's.
  bool has_begun_ = false;
  std::uint32_t left_out_bytes_ = 0;
  // The worker's.
  bool is_open_ = false;
  bool has_failed_ = false;
  std::uint16_t id_ = 0;          // of the log
  std::size_t unpacked_bytes_ = 0;  // of those that were put
  std::size_t taken_bytes_ = 0;     // as they are when unpacked
  std::array<std::uint8_t, kSlice> slice_;
};

}  // namespace foldcar
