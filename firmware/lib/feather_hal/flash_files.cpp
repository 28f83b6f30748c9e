#include "flash_files.h"

#include <Arduino.h>
#include <LittleFS.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "design_json.h"

namespace foldcar {
namespace {

constexpr const char* kDesignFile = "/car.json";
constexpr const char* kLogPrefix = "log_";

struct LogPath {
  explicit LogPath(std::uint16_t id) {
    std::snprintf(text, sizeof text, "/%s%05u", kLogPrefix, static_cast<unsigned>(id));
  }
  char text[16];
};

// The number of a log's file; 0 for other files. The name comes with or without its folder, by the core's version.
std::uint16_t log_id(const char* name) {
  if (name[0] == '/') ++name;
  if (std::strncmp(name, kLogPrefix, std::strlen(kLogPrefix)) != 0) return 0;
  return static_cast<std::uint16_t>(std::strtoul(name + std::strlen(kLogPrefix), nullptr, 10));
}

}  // namespace

bool FlashLogs::begin() {
  mounted_ = LittleFS.begin(true);
  if (mounted_) find_range();
  return mounted_;
}

bool FlashLogs::create(std::uint16_t id) {
  if (!mounted_) return false;
  written_ = LittleFS.open(LogPath(id).text, FILE_WRITE);
  if (!written_) return false;
  if (first_ == 0) first_ = id;
  last_ = id;
  return true;
}

// Flushed each time, so that a brown-out costs only what came after.
bool FlashLogs::append(const std::uint8_t* data, std::size_t size) {
  if (!written_ || written_.write(data, size) != size) return false;
  written_.flush();
  return true;
}

bool FlashLogs::close() {
  const bool was_open = static_cast<bool>(written_);
  written_.close();
  return was_open;
}

std::size_t FlashLogs::size(std::uint16_t id) { return open_to_read(id) ? read_.size() : 0; }

std::size_t FlashLogs::read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) {
  if (!open_to_read(id) || offset >= read_.size() || !read_.seek(static_cast<std::uint32_t>(offset))) return 0;
  return read_.read(data, size);
}

bool FlashLogs::remove(std::uint16_t id) {
  if (id < first_ || id > last_) return false;
  if (read_id_ == id) {
    read_.close();
    read_id_ = 0;
  }
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

// The file of the last request stays open, as a log is read in many small parts.
bool FlashLogs::open_to_read(std::uint16_t id) {
  if (id == 0 || id < first_ || id > last_) return false;
  if (read_id_ == id && read_) return true;
  read_ = LittleFS.open(LogPath(id).text, FILE_READ);
  read_id_ = read_ ? id : 0;
  return read_id_ != 0;
}

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

DesignResult read_car_json() {
  if (!LittleFS.exists(kDesignFile)) return {};
  CarDesignReader reader;
  fs::File file = LittleFS.open(kDesignFile, FILE_READ);
  if (!file) {
    reader.refuse("cannot be read");
    return reader.result();
  }
  if (file.size() > kLargestDesignFile) {
    reader.refuse("is larger than 8192 bytes");
    return reader.result();
  }
  const std::unique_ptr<char[]> text(new char[file.size()]);
  const std::size_t size = file.read(reinterpret_cast<std::uint8_t*>(text.get()), file.size());
  return read_design_json(text.get(), size);
}

}  // namespace foldcar
