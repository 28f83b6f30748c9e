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

// A battery at an analogue pin, through two resistors.
class FeatherBattery : public Battery {
 public:
  // divider: the battery's voltage divided by the pin's; 0: nothing is wired there.
  FeatherBattery(std::uint8_t pin, float divider) : pin_(pin), divider_(divider) {}
  void set_divider(float divider) { divider_ = divider; }
  float voltage_v() override;

 private:
  std::uint8_t pin_;
  float divider_;
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
  // Reads what the last run has left. To be called once, before the first question about it.
  void begin();
  // From now on a loop() that stands still restarts the board: the servo driver would continue with its pulses. Called from
  // loop()'s task. Without room for the guard, the SDK's watchdog does so alone, after a second.
  void start_watchdog();
  // From now on there is a button, between GPIO32 and ground.
  void use_button();
  void set_led(bool on) override;
  bool button_is_pressed() override;
  ResetReason reset_reason() const override;
  const CrashReport* crash_report() const override { return has_crashed_ ? &crash_report_ : nullptr; }
  void restart() override;
  bool is_simulated() const override { return false; }

 private:
  CrashReport crash_report_;
  bool has_crashed_ = false;
  bool has_button_ = false;
  bool led_is_output_ = false;
};

}  // namespace foldcar
