// Named numbers in the namespace "foldcar" of the ESP32's flash.
#pragma once

#include <Preferences.h>

#include "hal.h"

namespace foldcar {

// Without begin(), or after a failed one, there are none and none can be saved.
class FlashStorage : public Storage {
 public:
  bool begin();
  bool load(const char* name, float& value) override;
  bool save(const char* name, float value) override;
  bool clear() override;

 private:
  Preferences preferences_;
};

}  // namespace foldcar
