#include "log_writer.h"

namespace foldcar {

bool LogWriter::begin() {
  if (!is_idle()) return false;
  put_bytes_.store(0, std::memory_order_relaxed);
  taken_bytes_.store(0, std::memory_order_relaxed);
  unstored_bytes_.store(0, std::memory_order_relaxed);
  has_begun_ = true;
  left_out_bytes_ = 0;
  phase_.store(Phase::kRecording, std::memory_order_release);
  return true;
}

bool LogWriter::put(const std::uint8_t* record, std::size_t size, std::size_t reserve) {
  const std::uint32_t end = put_bytes_.load(std::memory_order_relaxed);
  const std::size_t queued = end - taken_bytes_.load(std::memory_order_acquire);
  if (queued + size + reserve > kQueueSize || end + size + reserve > kLogSize) return false;
  for (std::size_t i = 0; i < size; ++i) queue_[(end + i) % kQueueSize] = record[i];
  put_bytes_.store(end + static_cast<std::uint32_t>(size), std::memory_order_release);
  return true;
}

LogStatus LogWriter::status() const {
  const bool is_closed = is_idle();  // read first: of a closed log, all losses are seen then
  const std::uint32_t lost_bytes = left_out_bytes_ + unstored_bytes_.load(std::memory_order_relaxed);
  if (!is_closed) return {LogState::kOpen, lost_bytes};
  if (!has_begun_) return {};
  return {lost_bytes == 0 ? LogState::kStored : LogState::kIncomplete, lost_bytes};
}

// Does one step: prepares flash, opens the log, stores a slice or closes the log. Returns whether there is more to do.
bool LogWriter::work() {
  // Read first: of a finished log, all records are seen.
  const Phase phase = phase_.load(std::memory_order_acquire);
  if (phase == Phase::kIdle) return false;
  if (phase == Phase::kPreparing) return prepare();
  if (!is_open_ && !has_failed_) {
    open();
    return true;
  }
  if (store(phase == Phase::kFinished)) return true;
  if (phase == Phase::kRecording) return false;
  close();
  return true;
}

bool LogWriter::prepare() {
  if (storage_.prepare()) return true;
  phase_.store(Phase::kIdle, std::memory_order_release);
  return false;
}

void LogWriter::open() {
  id_ = storage_.create();
  is_open_ = id_ != 0;
  has_failed_ = !is_open_;
}

// Stores a slice; of a log that is being recorded, a whole one. Returns whether there was one. After a failure nothing more
// is stored, as a log with a gap in it could not be read behind the gap.
bool LogWriter::store(bool is_finished) {
  const std::uint32_t taken = taken_bytes_.load(std::memory_order_relaxed);
  const std::size_t queued = put_bytes_.load(std::memory_order_acquire) - taken;
  const std::size_t size = std::min(queued, kSlice);
  if (size == 0 || (size < kSlice && !is_finished)) return false;
  std::uint8_t slice[kSlice];
  for (std::size_t i = 0; i < size; ++i) slice[i] = queue_[(taken + i) % kQueueSize];
  taken_bytes_.store(taken + static_cast<std::uint32_t>(size), std::memory_order_release);
  has_failed_ = has_failed_ || !storage_.append(slice, size);
  if (has_failed_) unstored_bytes_.fetch_add(static_cast<std::uint32_t>(size), std::memory_order_relaxed);
  return true;
}

// Closes the log; what its size lacks of the bytes taken is lost.
void LogWriter::close() {
  const std::size_t stored = is_open_ && storage_.close() ? storage_.size(id_) : 0;
  unstored_bytes_.store(taken_bytes_.load(std::memory_order_relaxed) - static_cast<std::uint32_t>(stored),
                        std::memory_order_relaxed);
  is_open_ = has_failed_ = false;
  phase_.store(Phase::kPreparing, std::memory_order_release);
}

}  // namespace foldcar
