// Fake of Adafruit PWM Servo Driver 3.0.2: writes the registers that the library writes, in its order.
#pragma once

#include <memory>

#include "Adafruit_I2CDevice.h"

class Adafruit_PWMServoDriver {
 public:
  Adafruit_PWMServoDriver(std::uint8_t address, TwoWire& wire) : address_(address), wire_(&wire) {}

  // False if no chip answers. Else restarts the chip, which leaves its outputs as they are, and sets 25 MHz and 1 kHz.
  bool begin() {
    device_ = std::make_unique<Adafruit_I2CDevice>(address_, wire_);
    if (!device_->begin()) return false;
    write_register(kMode1, kRestart);
    delay(10);
    setOscillatorFrequency(25000000);
    setPWMFreq(1000.0f);
    return true;
  }

  // Changes the arithmetic of setPWMFreq only.
  void setOscillatorFrequency(std::uint32_t oscillator_hz) { oscillator_hz_ = oscillator_hz; }

  // The prescaler can be written only while the chip sleeps.
  void setPWMFreq(float rate_hz) {
    const float prescale = std::clamp(static_cast<float>(oscillator_hz_ / (rate_hz * 4096.0) + 0.5 - 1), 3.0f, 255.0f);
    const std::uint8_t mode = read_register(kMode1);
    write_register(kMode1, static_cast<std::uint8_t>((mode & ~kRestart) | kSleep));
    write_register(kPrescale, static_cast<std::uint8_t>(prescale));
    write_register(kMode1, mode);
    delay(5);
    write_register(kMode1, mode | kRestart | kAutoIncrement);
  }

  // A read that fails is not noticed and gives the register's address.
  std::uint8_t readPrescale() { return read_register(kPrescale); }

  // 0 if written, 1 if not. off of 4096 is the full-off bit.
  std::uint8_t setPWM(std::uint8_t channel, std::uint16_t on, std::uint16_t off) {
    const std::uint8_t bytes[5] = {static_cast<std::uint8_t>(0x06 + 4 * channel), static_cast<std::uint8_t>(on),
                                   static_cast<std::uint8_t>(on >> 8), static_cast<std::uint8_t>(off),
                                   static_cast<std::uint8_t>(off >> 8)};
    return device_->write(bytes, sizeof bytes) ? 0 : 1;
  }

 private:
  static constexpr std::uint8_t kMode1 = 0x00, kPrescale = 0xFE;
  static constexpr std::uint8_t kRestart = 0x80, kAutoIncrement = 0x20, kSleep = 0x10;

  std::uint8_t read_register(std::uint8_t index) {
    std::uint8_t byte = index;
    device_->write_then_read(&byte, 1, &byte, 1);
    return byte;
  }
  void write_register(std::uint8_t index, std::uint8_t value) {
    const std::uint8_t bytes[2] = {index, value};
    device_->write(bytes, sizeof bytes);
  }

  std::uint8_t address_;
  TwoWire* wire_;
  std::unique_ptr<Adafruit_I2CDevice> device_;  // none before begin
  std::uint32_t oscillator_hz_ = 0;
};
