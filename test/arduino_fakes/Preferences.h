// Fake of Arduino-ESP32 2.0.17: named values in the ESP32's non-volatile storage (NVS).
#pragma once

#include <cstring>
#include <string>

#include "fake_esp32.h"

class Preferences {
 public:
  ~Preferences() { end(); }

  // False if it is open already, the name is longer than 15 characters, or NVS cannot be opened.
  bool begin(const char* name, bool read_only = false) {
    if (is_open_ || std::strlen(name) > kLongestName || fake_esp32.flash.nvs_is_broken) return false;
    is_open_ = fake_esp32.flash.nvs_is_open = true;
    read_only_ = read_only;
    name_ = name;
    return true;
  }
  void end() { is_open_ = false; }

  bool isKey(const char* key) { return is_open_ && std::strlen(key) <= kLongestName && values().count(key) > 0; }

  // The bytes written: size, or 0 if it is not open for writing, the key is too long or there is no room.
  std::size_t putBytes(const char* key, const void* data, std::size_t size) {
    if (!is_open_ || read_only_ || size == 0 || std::strlen(key) > kLongestName) return 0;
    if (fake_esp32.flash.nvs_is_full) return 0;
    const auto* bytes = static_cast<const std::uint8_t*>(data);
    values()[key].assign(bytes, bytes + size);
    return size;
  }
  // The bytes read; 0 if there are none or they are more than fit.
  std::size_t getBytes(const char* key, void* into, std::size_t capacity) {
    if (!isKey(key) || values()[key].size() > capacity) return 0;
    std::memcpy(into, values()[key].data(), values()[key].size());
    return values()[key].size();
  }
  bool clear() {
    if (!is_open_ || read_only_) return false;
    values().clear();
    return true;
  }

 private:
  static constexpr std::size_t kLongestName = 15;

  std::map<std::string, std::vector<std::uint8_t>>& values() { return fake_esp32.flash.nvs[name_]; }

  bool is_open_ = false;
  bool read_only_ = false;
  std::string name_;
};
