// Fake of Adafruit BusIO 1.16.1: a chip at one address of an I2C bus.
#pragma once

#include "Wire.h"

class Adafruit_I2CDevice {
 public:
  explicit Adafruit_I2CDevice(std::uint8_t address, TwoWire* wire = &Wire) : address_(address), wire_(wire) {}

  // Begins the bus too. False if no chip acknowledges the address.
  bool begin() {
    wire_->begin();
    wire_->beginTransmission(address_);
    return wire_->endTransmission() == 0;
  }
  bool write(const std::uint8_t* data, std::size_t size, bool stop = true) {
    wire_->beginTransmission(address_);
    return wire_->write(data, size) == size && wire_->endTransmission(stop) == 0;
  }
  // The buffers may be the same. After an error the buffer to read into is unchanged.
  bool write_then_read(const std::uint8_t* data, std::size_t size, std::uint8_t* into, std::size_t count) {
    if (!write(data, size, false)) return false;
    if (wire_->requestFrom(address_, static_cast<std::uint8_t>(count), std::uint8_t{1}) != count) return false;
    for (std::size_t i = 0; i < count; ++i) into[i] = static_cast<std::uint8_t>(wire_->read());
    return true;
  }

 private:
  std::uint8_t address_;
  TwoWire* wire_;
};
