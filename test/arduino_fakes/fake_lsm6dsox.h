// The IMU's chip, ST LSM6DSOX (data sheet DS12814), as far as identity, ranges and outputs go.
#pragma once

#include <array>
#include <cmath>

#include "fake_esp32.h"

class FakeLsm6dsox : public I2cChip {
 public:
  std::uint8_t identity = 0x6C;
  std::array<double, 3> acceleration_m_s2{};
  std::array<double, 3> rate_rad_s{};

  // A dip of its supply: every register is as after power-on, and both sensors are off.
  void dip() {
    for (std::uint8_t& value : registers_) value = 0;
  }

  bool write(const std::vector<std::uint8_t>& bytes) override {
    if (bytes.empty()) return true;
    pointer_ = bytes[0];
    for (std::size_t i = 1; i < bytes.size(); ++i) registers_[pointer_++] = bytes[i];
    return true;
  }
  std::uint8_t read() override {
    const std::uint8_t at = pointer_++;
    if (at == 0x0F) return identity;
    if (at < 0x22 || at > 0x2D) return registers_[at];
    const std::size_t byte = at - 0x22u, axis = byte / 2 % 3;
    const bool is_rate = byte < 6;
    const double value = is_rate ? rate_rad_s[axis] / rate_per_bit() : acceleration_m_s2[axis] / acceleration_per_bit();
    const auto word = static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(value)));
    return static_cast<std::uint8_t>(byte % 2 == 0 ? word : word >> 8);
  }

 private:
  // Full scales: bits 3:2 of CTRL1_XL are 2, 16, 4, 8 g; of CTRL2_G 250, 500, 1000, 2000 degrees/s. Table 2 has the
  // sensitivities. An output rate of 0 (bits 7:4) switches a sensor off: it stays at 0.
  double acceleration_per_bit() const {
    constexpr double kMilliG[] = {0.061, 0.488, 0.122, 0.244};
    const std::uint8_t control = registers_[0x10];
    return control >> 4 == 0 ? INFINITY : kMilliG[control >> 2 & 3] * 1e-3 * 9.80665;
  }
  double rate_per_bit() const {
    constexpr double kMilliDegrees[] = {8.75, 17.5, 35.0, 70.0};
    const std::uint8_t control = registers_[0x11];
    return control >> 4 == 0 ? INFINITY : kMilliDegrees[control >> 2 & 3] * 1e-3 * M_PI / 180;
  }

  std::uint8_t registers_[256] = {};
  std::uint8_t pointer_ = 0;
};
