#include "log_writer.h"

namespace foldcar {

bool LogWriter::begin() {
  if (!is_idle()) return false;
  put_bytes_ = unpacked_bytes_ = 0;
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

// Does one step of storing a finished log in flash. Returns whether there is more to do.
bool LogWriter::work() {
  // Of a finished log, all records are seen.
  if (phase_.load(std::memory_order_acquire) != Phase::kFinished) return false;
  if (unpacked_bytes_ == put_bytes_) return close();
  if (is_open_ || has_failed_) {
    store();
  } else {
    open();
  }
  return true;
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

// Unpacks as many records as fit a slice and appends them to the file. After a failure nothing more is stored, as a
// log with a gap could not be read behind it; the records are only counted as lost.
void LogWriter::store() {
  std::size_t size = 0;
  while (size + kLargestRecord <= kSlice && unpacked_bytes_ < put_bytes_) {
    const LogFormat::Unpacked record = format_.unpack(packed_.data() + unpacked_bytes_, slice_.data() + size);
    unpacked_bytes_ += record.packed_size;
    size += record.size;
  }
  has_failed_ = has_failed_ || !storage_.append(slice_.data(), size);
  if (has_failed_) unstored_bytes_.fetch_add(static_cast<std::uint32_t>(size), std::memory_order_relaxed);
  taken_bytes_ += size;
}

// Closes the file; what its size lacks of the bytes taken is lost.
bool LogWriter::close() {
  const std::size_t stored = is_open_ && storage_.close() ? storage_.size(id_) : 0;
  unstored_bytes_.store(static_cast<std::uint32_t>(taken_bytes_ - stored), std::memory_order_relaxed);
  is_open_ = has_failed_ = false;
  phase_.store(Phase::kIdle, std::memory_order_release);
  return false;
}

}  // namespace foldcar
