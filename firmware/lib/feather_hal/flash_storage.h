// Named numbers in the ESP32's non-volatile storage, in its namespace "foldcar".
#pragma once

#include <Preferences.h>

#include "hal.h"

namespace foldcar {

// Until begin() has succeeded nothing can be loaded or saved.
class FlashStorage : public Storage {
 public:
  // Returns false if the storage cannot be opened.
  bool begin();
  bool present() const override { return open_; }
  bool load(const char* name, float& value) override;
  bool save(const char* name, float value) override;
  bool clear() override;

 private:
  Preferences preferences_;
  bool open_ = false;
};

}  // namespace foldcar
