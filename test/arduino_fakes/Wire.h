// Fake of Arduino-ESP32 2.0.17: the I2C master.
#pragma once

#include "Arduino.h"

class TwoWire {
 public:
  // On a running bus both do nothing: pins and frequency stay.
  bool begin() { return begin(23, 22); }
  bool begin(int sda, int scl, std::uint32_t frequency_hz = 100000) {
    FakeI2c& bus = fake_esp32.i2c;
    if (bus.begun) return true;
    if (bus.driver_fails) return false;
    bus.begun = true;
    bus.sda = sda;
    bus.scl = scl;
    bus.clock_hz = frequency_hz;
    return true;
  }
  void setTimeOut(std::uint16_t time_out_ms) { fake_esp32.i2c.time_out_ms = time_out_ms; }

  void beginTransmission(std::uint8_t address) {
    FakeI2c& bus = fake_esp32.i2c;
    bus.address = address;
    bus.repeated_start = false;
    bus.sending.clear();
  }
  // How many bytes found room in the buffer; there is none before begin.
  std::size_t write(std::uint8_t byte) {
    FakeI2c& bus = fake_esp32.i2c;
    if (!bus.begun || bus.sending.size() == kBuffer) return 0;
    bus.sending.push_back(byte);
    return 1;
  }
  std::size_t write(const std::uint8_t* data, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) {
      if (write(data[i]) == 0) return i;
    }
    return size;
  }
  // 0 sent, 2 not acknowledged, 4 other error, 5 time-out. Without a stop nothing is sent until requestFrom.
  std::uint8_t endTransmission(bool stop = true) {
    if (!fake_esp32.i2c.begun) return 4;
    fake_esp32.i2c.repeated_start = !stop;
    return stop ? send() : 0;
  }
  // The number of bytes received: size, or 0 after an error.
  std::size_t requestFrom(std::uint8_t address, std::uint8_t size, std::uint8_t) {
    FakeI2c& bus = fake_esp32.i2c;
    bus.received.clear();
    const bool sends_first = bus.repeated_start;
    bus.repeated_start = false;
    if (!bus.begun || bus.bus_hangs || bus.chips.count(address) == 0) return 0;
    if (sends_first && (address != bus.address || send() != 0)) return 0;
    for (std::size_t i = 0; i < size; ++i) bus.received.push_back(bus.chips[address]->read());
    return size;
  }
  int read() {
    std::deque<std::uint8_t>& received = fake_esp32.i2c.received;
    if (received.empty()) return -1;
    const int byte = received.front();
    received.pop_front();
    return byte;
  }

 private:
  static constexpr std::size_t kBuffer = 128;

  std::uint8_t send() {
    FakeI2c& bus = fake_esp32.i2c;
    if (bus.bus_hangs) return 5;
    if (bus.fails_at >= 0 && bus.fails_at-- == 0) return 2;
    const auto chip = bus.chips.find(bus.address);
    return chip != bus.chips.end() && chip->second->write(bus.sending) ? 0 : 2;
  }
};

inline TwoWire Wire;
