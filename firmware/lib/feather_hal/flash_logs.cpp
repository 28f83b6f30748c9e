#include "flash_logs.h"

#include <Arduino.h>
#include <LittleFS.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace foldcar {
namespace {

constexpr const char* kLogPrefix = "log_";
// LittleFS copies a file's last block, and so erases another, after every flush.
constexpr std::size_t kFlushedBytes = 32 * 1024;
// Bytes of the file system that logs leave free: what a flush copies, and blocks of LittleFS's own. Where none is
// free, the LittleFS of Arduino-ESP32 2.0.17 divides by zero (littlefs pull request 966).
constexpr std::size_t kReserve = 32 * 1024;

bool has_room_for(std::size_t size) { return LittleFS.usedBytes() + size + kReserve <= LittleFS.totalBytes(); }

struct LogPath {
  explicit LogPath(std::uint16_t id) {
    std::snprintf(text, sizeof text, "/%s%05u", kLogPrefix, static_cast<unsigned>(id));
  }
  char text[16];
};

// The number of a log's file, whose name comes without its folder; 0 for other files.
std::uint16_t log_id(const char* name) {
  if (std::strncmp(name, kLogPrefix, std::strlen(kLogPrefix)) != 0) return 0;
  return static_cast<std::uint16_t>(std::strtoul(name + std::strlen(kLogPrefix), nullptr, 10));
}

}  // namespace

bool FlashLogs::begin() {
  mounted_ = LittleFS.begin(false);
  if (mounted_) find_range();
  return mounted_;
}

void FlashLogs::give_up() {
  mounted_ = false;
  first_ = last_ = 0;
}

bool FlashLogs::create(std::uint16_t id) {
  if (!mounted_ || id == 0 || !has_room_for(0)) return false;
  close_reading();
  written_ = LittleFS.open(LogPath(id).text, FILE_WRITE);
  written_size_ = flushed_size_ = 0;
  if (!written_) return false;
  first_ = first_ == 0 ? id : std::min(first_, id);
  last_ = std::max(last_, id);
  return true;
}

// Appends to the open log, and flushes every kFlushedBytes: a brown-out loses the data since the last flush. Returns
// whether the data were stored; flush() reports no error, but the size of the file shows it.
bool FlashLogs::append(const std::uint8_t* data, std::size_t size) {
  if (!written_ || !has_room_for(written_size_ - flushed_size_ + size)) return false;
  if (written_.write(data, size) != size) return false;
  written_size_ += size;
  if (written_size_ - flushed_size_ < kFlushedBytes) return true;
  written_.flush();
  flushed_size_ = written_size_;
  return written_.size() == written_size_;
}

// Closes the log that is written, and the one that is read: a file opened to read before the last part was written
// would not have that part.
bool FlashLogs::close() {
  const bool was_open = static_cast<bool>(written_);
  written_.close();
  close_reading();
  return was_open;
}

std::size_t FlashLogs::size(std::uint16_t id) { return open_to_read(id) ? read_.size() : 0; }

std::size_t FlashLogs::read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) {
  if (!open_to_read(id) || offset >= read_.size()) return 0;
  if (offset != read_at_ && !read_.seek(static_cast<std::uint32_t>(offset))) return 0;
  const std::size_t count = read_.read(data, size);
  read_at_ = offset + count;
  return count;
}

// LittleFS does not remove a file that is open.
bool FlashLogs::remove(std::uint16_t id) {
  if (id == 0 || id < first_ || id > last_) return false;
  if (read_id_ == id) close_reading();
  const bool removed = LittleFS.remove(LogPath(id).text);
  find_range();
  return removed;
}

bool FlashLogs::range(std::uint16_t& first, std::uint16_t& last) {
  if (first_ == 0) return false;
  first = first_;
  last = last_;
  return true;
}

// The file of the last request stays open where it was read to, because a log is read in many small parts: opening and
// seeking read flash.
bool FlashLogs::open_to_read(std::uint16_t id) {
  if (id == 0 || id < first_ || id > last_) return false;
  if (read_id_ == id && read_) return true;
  close_reading();
  read_ = LittleFS.open(LogPath(id).text, FILE_READ);
  read_id_ = read_ ? id : 0;
  read_at_ = 0;
  return read_id_ != 0;
}

void FlashLogs::close_reading() {
  read_.close();
  read_id_ = 0;
}

// Finds the smallest and largest number of the logs in flash; both 0 if there are no logs.
void FlashLogs::find_range() {
  first_ = last_ = 0;
  fs::File root = LittleFS.open("/");
  for (fs::File file = root.openNextFile(); file; file = root.openNextFile()) {
    const std::uint16_t id = log_id(file.name());
    if (id == 0) continue;
    if (first_ == 0 || id < first_) first_ = id;
    if (id > last_) last_ = id;
  }
}

}  // namespace foldcar
