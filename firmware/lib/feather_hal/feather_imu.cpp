#include "feather_imu.h"

#include <algorithm>
#include <cstdint>

#include <Arduino.h>
#include <Wire.h>

namespace foldcar {
namespace {

// Registers and sensitivities: LSM6DSOX data sheet, ST DS12814.
constexpr std::uint8_t kWhoAmI = 0x0F;
constexpr std::uint8_t kIdentity = 0x6C;  // what WHO_AM_I holds
constexpr std::uint8_t kFirstOutput = 0x22;  // 6 bytes of the gyroscope, then 6 of the accelerometer
constexpr std::uint8_t kSettings[][2] = {
    {0x12, 0x44},  // CTRL3_C: outputs stay the same while they are read; the register address increments
    {0x10, 0x58},  // CTRL1_XL: 208 Hz, +-4 g
    {0x11, 0x54},  // CTRL2_G: 208 Hz, +-500 degrees/s
};
constexpr float kAccelerationPerBit = 0.122e-3f * 9.80665f;             // m/s²
constexpr float kRatePerBit = 17.5e-3f * 3.14159265f / 180.0f;          // rad/s

// Checks that the device is the IMU and writes its settings. Returns whether both succeeded.
bool set_up(Adafruit_I2CDevice& device) {
  std::uint8_t identity = 0;
  if (!device.begin() || !device.write_then_read(&kWhoAmI, 1, &identity, 1) || identity != kIdentity) return false;
  for (const auto& setting : kSettings) {
    if (!device.write(setting, sizeof setting)) return false;
  }
  return true;
}

// The signed 16-bit number at this place, low byte first.
float value_at(const std::uint8_t* bytes) {
  return static_cast<float>(static_cast<std::int16_t>(bytes[0] | (bytes[1] << 8)));
}

}  // namespace

FeatherImu::FeatherImu() : at_6a_(0x6A, &Wire), at_6b_(0x6B, &Wire) {}

bool FeatherImu::begin() {
  for (Adafruit_I2CDevice* device : {&at_6a_, &at_6b_}) {
    if (device_ == nullptr && set_up(*device)) device_ = device;
  }
  return device_ != nullptr;
}

bool FeatherImu::read(ImuSample& sample) {
  std::uint8_t bytes[12];
  const auto answers = [&] { return device_->write_then_read(&kFirstOutput, 1, bytes, sizeof bytes); };
  // The second attempt is for a transfer that an erasure of flash has interrupted.
  if (device_ == nullptr || !(answers() || answers())) return false;
  // After a dip of its supply the chip is switched off: it answers zeros, which no working one does on six axes.
  if (std::all_of(bytes, bytes + sizeof bytes, [](std::uint8_t byte) { return byte == 0; })) return false;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    sample.rate_rad_s[axis] = kRatePerBit * value_at(bytes + 2 * axis);
    sample.acceleration_m_s2[axis] = kAccelerationPerBit * value_at(bytes + 6 + 2 * axis);
  }
  return true;
}

}  // namespace foldcar
