// The ESP32 of the HUZZAH32 Feather: clock, battery voltage, USB serial port, reset.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal.h"

namespace foldcar {

class FeatherClock : public Clock {
 public:
  std::uint64_t now_us() const override;
};

// The board's LiPo cell, measured through the divider of 100 kΩ and 100 kΩ at A13.
class FeatherBattery : public Battery {
 public:
  float voltage_v() override;
};

class SerialLink : public ByteLink {
 public:
  // Opens the port. baud: bits per second.
  void begin(std::uint32_t baud);
  std::size_t read(std::uint8_t* data, std::size_t size) override;
  std::size_t write(const std::uint8_t* data, std::size_t size) override;
};

class Esp32Board : public Board {
 public:
  // Restarts the board whenever loop() takes longer than 1 s: the servo driver would continue with its pulses.
  void start_watchdog();
  ResetReason reset_reason() const override;
  void restart() override;
  bool is_simulated() const override { return false; }
};

}  // namespace foldcar
