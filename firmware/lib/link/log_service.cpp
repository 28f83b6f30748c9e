#include "log_service.h"

#include <algorithm>

namespace foldcar {
namespace {

constexpr std::size_t kPart = sizeof(mavlink_log_data_t::data);
// Bytes read from flash in one call: in packets, what 115200 baud carry from one tick to the next.
constexpr std::size_t kRead = 2 * kPart;

}  // namespace

void LogService::list(const mavlink_log_request_list_t& request) {
  const LogRange logs = storage_.range();
  if (logs.is_empty()) return send_entry(0);
  next_entry_ = logs.oldest;
  last_entry_ = logs.newest;
  first_asked_ = request.start;
  last_asked_ = request.end;
}

void LogService::data(const mavlink_log_request_data_t& request) {
  log_ = request.id;
  const std::size_t size = storage_.size(log_);
  offset_ = request.ofs;
  end_ = std::min<std::size_t>(size, offset_ + std::min<std::size_t>(size, request.count));
}

void LogService::erase() {
  end();
  erased_to_ = storage_.range().newest;
}

void LogService::end() {
  next_entry_ = 0;
  offset_ = end_ = 0;
}

// Does one step of what is asked for: erases one log, or sends one list entry or one part of a log if the outbox has
// room.
void LogService::run() {
  if (erased_to_ > 0) return erase_one();
  if (!outbox_.has_room_for(8)) return;
  if (next_entry_ > 0) return list_one();
  if (offset_ < end_) send_data();
}

// Numbers wrap around, so the oldest log may have the largest one.
void LogService::list_one() {
  const std::uint16_t id = next_entry_;
  next_entry_ = id == last_entry_ ? std::uint16_t{0} : next_log_number(id);
  if (id >= first_asked_ && id <= last_asked_) send_entry(id);
}

// Erases the oldest log, up to the last one at the time of the request; a log that a trial has added since stays.
void LogService::erase_one() {
  const LogRange logs = storage_.range();
  const bool any = !logs.is_empty() && !is_newer_log(logs.oldest, erased_to_);
  if (!any || !storage_.remove(logs.oldest)) erased_to_ = 0;
}

void LogService::send_data() {
  std::uint8_t bytes[kRead];
  const std::size_t size = storage_.read(log_, offset_, bytes, std::min(kRead, end_ - offset_));
  if (size == 0) return end();
  for (std::size_t at = 0; at < size; at += kPart) {
    mavlink_log_data_t content{};
    content.id = log_;
    content.ofs = static_cast<std::uint32_t>(offset_ + at);
    content.count = static_cast<std::uint8_t>(std::min(kPart, size - at));
    std::copy_n(bytes + at, content.count, content.data);
    outbox_.send(mavlink_msg_log_data_encode_status, content, Priority::kAnswer);
  }
  offset_ += size;
}

void LogService::send_entry(std::uint16_t id) {
  const LogRange logs = storage_.range();
  mavlink_log_entry_t content{};
  content.id = id;
  content.num_logs = logs.count();
  content.last_log_num = logs.newest;
  content.size = static_cast<std::uint32_t>(storage_.size(id));
  outbox_.send(mavlink_msg_log_entry_encode_status, content, Priority::kAnswer);
}

}  // namespace foldcar
