// The servo driver's chip, PCA9685 (NXP data sheet, rev. 4), as far as its registers decide about pulses.
#pragma once

#include <cmath>

#include "fake_esp32.h"

class FakePca9685 : public I2cChip {
 public:
  double oscillator_hz = 25e6;  // 23 to 27 MHz from chip to chip
  std::vector<std::vector<std::uint8_t>> transmissions;  // every one that carried bytes
  bool has_driven = false;  // any output had a pulse after a transmission

  FakePca9685() {
    registers_[kMode1] = 0x11;
    registers_[kPrescale] = 0x1E;
    for (std::size_t channel = 0; channel < 16; ++channel) registers_[kFirstOutput + 4 * channel + 3] = kFullOff;
  }

  bool write(const std::vector<std::uint8_t>& bytes) override {
    if (bytes.empty()) return true;
    transmissions.push_back(bytes);
    pointer_ = bytes[0];
    for (std::size_t i = 1; i < bytes.size(); ++i) {
      put(bytes[i]);
      advance();
    }
    for (std::size_t channel = 0; channel < 16; ++channel) has_driven = has_driven || pulse_us(channel) > 0;
    return true;
  }
  std::uint8_t read() override {
    const std::uint8_t byte = registers_[pointer_];
    advance();
    return byte;
  }

  // Length (µs) and period (µs) of the pulses that leave an output; 0 for no pulse.
  double pulse_us(std::size_t channel) const {
    const std::uint8_t* output = registers_ + kFirstOutput + 4 * channel;
    if ((output[3] & kFullOff) != 0 || (registers_[kMode1] & kSleep) != 0) return 0;
    const int on = output[0] | (output[1] & 0x0F) << 8, off = output[2] | (output[3] & 0x0F) << 8;
    return ((off - on) & 0xFFF) * tick_us();
  }
  double period_us() const { return 4096 * tick_us(); }
  double tick_us() const { return 1e6 * (registers_[kPrescale] + 1) / oscillator_hz; }

 private:
  static constexpr std::uint8_t kMode1 = 0x00, kFirstOutput = 0x06, kAllOutputs = 0xFA, kPrescale = 0xFE;
  static constexpr std::uint8_t kAutoIncrement = 0x20, kSleep = 0x10, kFullOff = 0x10;

  void put(std::uint8_t value) {
    if (pointer_ >= kAllOutputs && pointer_ < kAllOutputs + 4) {
      for (std::size_t channel = 0; channel < 16; ++channel) {
        registers_[kFirstOutput + 4 * channel + pointer_ - kAllOutputs] = value;
      }
    } else if (pointer_ == kMode1) {
      registers_[kMode1] = value & 0x7F;  // the restart bit is cleared by writing 1 to it
    } else if (pointer_ != kPrescale || (registers_[kMode1] & kSleep) != 0) {
      registers_[pointer_] = value;
    }
  }
  void advance() {
    if ((registers_[kMode1] & kAutoIncrement) != 0) ++pointer_;
  }

  std::uint8_t registers_[256] = {};
  std::uint8_t pointer_ = 0;
};
