// Fake of Arduino-ESP32 2.0.17: the file system of the ESP32's flash.
#pragma once

#include "FS.h"

namespace fs {

class LittleFSFS : public FS {
 public:
  // Mounts it; where there is none, formats the partition if asked to. True if it is mounted already.
  bool begin(bool format_on_fail = false) {
    FakeFlash& flash = fake_esp32.flash;
    if (flash.is_mounted) return true;
    if (!flash.is_formatted && format_on_fail) {
      flash.files.clear();
      flash.is_formatted = true;
    }
    return flash.is_mounted = flash.is_formatted;
  }
};

}  // namespace fs

inline fs::LittleFSFS LittleFS;
