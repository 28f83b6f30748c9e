#include "log_service.h"

#include <algorithm>

namespace foldcar {
namespace {

// Largest number of packets of each kind in one call, because reading flash takes time.
constexpr int kMaxPackets = 4;
constexpr std::size_t kPart = sizeof(mavlink_log_data_t::data);

}  // namespace

void LogService::list(const mavlink_log_request_list_t& request) {
  std::uint16_t first = 0, last = 0;
  if (!storage_.range(first, last)) return send_entry(0);
  next_entry_ = std::max(first, request.start);
  last_entry_ = std::min(last, request.end);
}

void LogService::data(const mavlink_log_request_data_t& request) {
  log_ = request.id;
  const std::size_t size = storage_.size(log_);
  offset_ = request.ofs;
  end_ = std::min<std::size_t>(size, offset_ + std::min<std::size_t>(size, request.count));
}

void LogService::erase() {
  end();
  std::uint16_t first = 0, last = 0;
  if (!storage_.range(first, last)) return;
  for (std::uint32_t id = first; id <= last; ++id) storage_.remove(static_cast<std::uint16_t>(id));
}

void LogService::end() {
  next_entry_ = 1;
  last_entry_ = 0;
  offset_ = end_ = 0;
}

void LogService::run() {
  for (int i = 0; i < kMaxPackets && next_entry_ <= last_entry_ && outbox_.has_room_for(8); ++i) {
    send_entry(static_cast<std::uint16_t>(next_entry_++));
  }
  for (int i = 0; i < kMaxPackets && offset_ < end_ && outbox_.has_room_for(8); ++i) {
    mavlink_log_data_t content{};
    content.id = log_;
    content.ofs = static_cast<std::uint32_t>(offset_);
    const std::size_t count = storage_.read(log_, offset_, content.data, std::min(kPart, end_ - offset_));
    if (count == 0) return end();
    content.count = static_cast<std::uint8_t>(count);
    outbox_.send(mavlink_msg_log_data_encode_status, content, Priority::kAnswer);
    offset_ += count;
  }
}

void LogService::send_entry(std::uint16_t id) {
  std::uint16_t first = 0, last = 0;
  const bool any = storage_.range(first, last);
  mavlink_log_entry_t content{};
  content.id = id;
  content.num_logs = any ? static_cast<std::uint16_t>(last - first + 1) : 0;
  content.last_log_num = last;
  content.size = static_cast<std::uint32_t>(storage_.size(id));
  outbox_.send(mavlink_msg_log_entry_encode_status, content, Priority::kAnswer);
}

}  // namespace foldcar
