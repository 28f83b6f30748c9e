// Fake of Arduino-ESP32 2.0.17: files that are read.
#pragma once

#include <memory>

#include "Arduino.h"

#define FILE_READ "r"

namespace fs {

// What an open handle refers to: the file as it was when it was opened.
struct OpenFile {
  std::string content;
  std::size_t position = 0;
};

class File {
 public:
  explicit File(std::shared_ptr<OpenFile> open = nullptr) : open_(std::move(open)) {}
  explicit operator bool() const { return open_ != nullptr; }

  std::size_t size() const { return open_ ? open_->content.size() : 0; }
  // (size_t)-1 without an open file.
  std::size_t read(std::uint8_t* into, std::size_t size) {
    if (!open_) return static_cast<std::size_t>(-1);
    if (fake_esp32.flash.read_fails) size /= 2;
    if (open_->position >= open_->content.size()) return 0;
    const std::size_t count = open_->content.copy(reinterpret_cast<char*>(into), size, open_->position);
    open_->position += count;
    return count;
  }

 private:
  std::shared_ptr<OpenFile> open_;
};

class FS {
 public:
  // An empty File if the file system is not mounted, the path does not begin with /, or the file does not exist.
  File open(const char* path, const char* = FILE_READ) {
    const FakeFlash& flash = fake_esp32.flash;
    if (!flash.is_mounted || path[0] != '/' || flash.files.count(path) == 0) return File();
    return File(std::make_shared<OpenFile>(OpenFile{flash.files.at(path)}));
  }
  bool exists(const char* path) { return static_cast<bool>(open(path)); }
};

}  // namespace fs
