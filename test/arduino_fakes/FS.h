// Fake of Arduino-ESP32 2.0.17: files and folders. A file written to is buffered and committed by flush or close; a
// file opened to read holds what was committed when it was opened.
#pragma once

#include <memory>

#include "Arduino.h"

#define FILE_READ "r"
#define FILE_WRITE "w"

namespace fs {

// What an open handle refers to. Closed with its last owner.
struct OpenFile {
  std::string path;
  bool writes = false;
  std::string content;
  std::size_t position = 0;
  std::size_t size = 0;  // as of the last look at the file system
  std::vector<std::string> entries;  // of a folder
  std::size_t next_entry = 0;
  bool is_folder = false;

  ~OpenFile() {
    commit();
    --fake_esp32.flash.open_count[path];
  }
  // A file system that fails keeps what it has; nothing reports that. Without a free block, LittleFS divides by zero.
  void commit() {
    FakeFlash& flash = fake_esp32.flash;
    if (!writes || !flash.is_mounted || flash.write_fails) return;
    const std::string before = flash.files[path];
    flash.files[path] = content;
    if (used_fake_bytes(flash) < flash.capacity) return;
    flash.divided_by_zero = true;
    flash.files[path] = before;
  }
};

class File {
 public:
  explicit File(std::shared_ptr<OpenFile> open = nullptr) : open_(std::move(open)) {}
  explicit operator bool() const { return open_ != nullptr; }

  // Bytes that the buffer took.
  std::size_t write(const std::uint8_t* data, std::size_t size) {
    if (!open_ || !open_->writes) return 0;
    open_->content.append(reinterpret_cast<const char*>(data), size);
    return size;
  }
  void flush() {
    if (open_) open_->commit();
  }
  void close() { open_.reset(); }

  // Of a file that was written to: what is committed. Else: as it was when it was opened.
  std::size_t size() const {
    if (!open_) return 0;
    if (open_->writes) open_->size = fake_esp32.flash.files[open_->path].size();
    return open_->size;
  }
  bool seek(std::uint32_t position) {
    if (open_) open_->position = position;
    return open_ != nullptr;
  }
  // (size_t)-1 without an open file.
  std::size_t read(std::uint8_t* into, std::size_t size) {
    if (!open_) return static_cast<std::size_t>(-1);
    if (fake_esp32.flash.read_fails) size /= 2;
    if (open_->writes || open_->position >= open_->content.size()) return 0;
    const std::size_t count = open_->content.copy(reinterpret_cast<char*>(into), size, open_->position);
    open_->position += count;
    return count;
  }
  // Without its folder.
  const char* name() const { return open_ ? open_->path.c_str() + open_->path.rfind('/') + 1 : nullptr; }
  File openNextFile();

 private:
  std::shared_ptr<OpenFile> open_;
};

class FS {
 public:
  // An empty File if the file system is not mounted, the path does not begin with /, or the file to read does not exist.
  File open(const char* path, const char* mode = FILE_READ) {
    FakeFlash& flash = fake_esp32.flash;
    if (!flash.is_mounted || path[0] != '/') return File();
    auto file = std::make_shared<OpenFile>();
    file->path = path;
    ++flash.open_count[path];
    if (std::string(path) == "/") {
      file->is_folder = true;
      for (const auto& [name, content] : flash.files) file->entries.push_back(name);
    } else if (std::string(mode) == FILE_WRITE) {
      file->writes = true;
      flash.divided_by_zero = flash.divided_by_zero || used_fake_bytes(flash) >= flash.capacity;
      flash.files.emplace(path, "");
    } else if (flash.files.count(path) == 0) {
      return File();
    } else {
      file->content = flash.files[path];
      file->size = file->content.size();
    }
    return File(file);
  }
  bool exists(const char* path) { return static_cast<bool>(open(path)); }
  // False for a file that does not exist or is open.
  bool remove(const char* path) {
    FakeFlash& flash = fake_esp32.flash;
    return flash.is_mounted && flash.open_count[path] == 0 && flash.files.erase(path) > 0;
  }
};

}  // namespace fs
