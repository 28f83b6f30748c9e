// The parts of the HUZZAH32 Feather other than the servos: clock, battery, USB serial, flash.
#pragma once

#include <Preferences.h>

#include "hal.h"

namespace foldcar {

class FeatherClock : public Clock {
 public:
  std::uint64_t now_us() const override;
};

// The board's LiPo, through its divider on A13.
class FeatherBattery : public Battery {
 public:
  float voltage_v() override;
};

class SerialLink : public ByteLink {
 public:
  void begin(std::uint32_t baud);
  std::size_t read(std::uint8_t* data, std::size_t size) override;
  std::size_t write(const std::uint8_t* data, std::size_t size) override;
};

// Named numbers in the namespace "foldcar" of the flash. Without begin(), or after a failed one, there are
// none and none can be saved.
class FlashStorage : public Storage {
 public:
  bool begin();
  bool load(const char* name, float& value) override;
  bool save(const char* name, float value) override;

 private:
  Preferences preferences_;
};

}  // namespace foldcar
