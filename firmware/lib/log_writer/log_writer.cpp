#include "log_writer.h"

namespace foldcar {

bool LogWriter::begin() {
  if (!is_idle()) return false;
  ring_.clear();
  format_.begin();
  has_begun_ = true;
  left_out_bytes_ = 0;
  unstored_bytes_.store(0, std::memory_order_relaxed);
  taken_bytes_ = 0;
  phase_.store(Phase::kRecording, std::memory_order_release);
  return true;
}

LogStatus LogWriter::status() const {
  const bool is_closed = is_idle();  // read first: of a closed log, all losses are seen then
  const std::uint32_t lost_bytes = left_out_bytes_ + unstored_bytes_.load(std::memory_order_relaxed);
  if (!is_closed) return {LogState::kOpen, lost_bytes};
  if (!has_begun_) return {};
  return {lost_bytes == 0 ? LogState::kStored : LogState::kIncomplete, lost_bytes};
}

bool LogWriter::work() {
  // Read before the ring: of a finished log, all records are seen then.
  const Phase phase = phase_.load(std::memory_order_acquire);
  if (phase == Phase::kIdle) return false;
  const std::size_t waiting = ring_.waiting();
  if (wheels_turn_.load(std::memory_order_acquire) || phase == Phase::kRecording) {
    if (waiting >= kKept) step(kSlice);
    return false;
  }
  if (waiting == 0) return close();
  step(kStandingSlice);
  return true;
}

void LogWriter::step(std::size_t largest) {
  if (is_open_ || has_failed_) return store(largest);
  open();
}

// Removes one surplus log, or creates the new one.
void LogWriter::open() {
  std::uint16_t first = 1, last = 0;
  storage_.range(first, last);
  id_ = static_cast<std::uint16_t>(last + 1);
  if (first + kLogsKept <= id_ && storage_.remove(first)) return;
  is_open_ = storage_.create(id_);
  has_failed_ = !is_open_;
}

// After a failure nothing more is stored, as a log with a gap in it could not be read behind the gap.
void LogWriter::store(std::size_t largest) {
  std::size_t size = 0;
  std::uint8_t packed[kLargestPacked];
  while (size + kLargestRecord <= largest && ring_.copy(packed, sizeof packed) > 0) {
    const LogFormat::Unpacked record = format_.unpack(packed, slice_.data() + size);
    ring_.take(record.packed_size);
    size += record.size;
  }
  has_failed_ = has_failed_ || !storage_.append(slice_.data(), size);
  if (has_failed_) unstored_bytes_.fetch_add(static_cast<std::uint32_t>(size), std::memory_order_relaxed);
  taken_bytes_ += size;
}

bool LogWriter::close() {
  const std::size_t stored = is_open_ && storage_.close() ? storage_.size(id_) : 0;
  unstored_bytes_.store(static_cast<std::uint32_t>(taken_bytes_ - stored), std::memory_order_relaxed);
  is_open_ = has_failed_ = false;
  phase_.store(Phase::kIdle, std::memory_order_release);
  return false;
}

}  // namespace foldcar
