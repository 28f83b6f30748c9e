// The ESP32 of the HUZZAH32 Feather: clock, battery, USB serial, reset.
#pragma once

#include <cstddef>
#include <cstdint>

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

// Why the ESP32 has started, its restart, and a watchdog that restarts it when loop() hangs: the servo driver would go on
// with its pulses.
class Esp32Board : public Board {
 public:
  // From here on loop() must come round at least once a second.
  void start_watchdog();
  ResetReason reset_reason() const override;
  void restart() override;
};

}  // namespace foldcar
