#include "log_writer.h"

#include <algorithm>

namespace foldcar {

bool LogWriter::begin() {
  if (!is_idle()) return false;
  ring_.clear();
  has_begun_ = true;
  left_out_bytes_ = 0;
  unstored_bytes_.store(0, std::memory_order_relaxed);
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
  const bool is_due = waiting >= kBlock || (phase == Phase::kFinished && waiting > 0);
  if (is_due && !is_open_ && !has_failed_) return open();
  if (is_due) {
    store();
    return true;
  }
  return phase == Phase::kFinished && close();
}

// Removes one surplus log, or creates the new one.
bool LogWriter::open() {
  std::uint16_t first = 1, last = 0;
  storage_.range(first, last);
  const auto id = static_cast<std::uint16_t>(last + 1);
  if (first + kLogsKept <= id && storage_.remove(first)) return true;
  is_open_ = storage_.create(id);
  has_failed_ = !is_open_;
  return true;
}

// After a failure nothing more is stored, as a log with a gap in it could not be read behind the gap.
void LogWriter::store() {
  std::size_t size = 0;
  const std::uint8_t* bytes = ring_.first(size);
  size = std::min<std::size_t>(size, kBlock);
  has_failed_ = has_failed_ || !storage_.append(bytes, size);
  if (has_failed_) unstored_bytes_.fetch_add(static_cast<std::uint32_t>(size), std::memory_order_relaxed);
  ring_.take(size);
}

bool LogWriter::close() {
  if (is_open_) storage_.close();
  is_open_ = has_failed_ = false;
  phase_.store(Phase::kIdle, std::memory_order_release);
  return false;
}

}  // namespace foldcar
