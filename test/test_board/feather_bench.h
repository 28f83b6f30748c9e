// A board on the bench: the HAL, the fake ESP32 under it, and the chips on its bus.
#pragma once

#include <unity.h>

#include "../../firmware/lib/feather_hal/feather_hal.h"
#include "../arduino_fakes/fake_lsm6dsox.h"
#include "../arduino_fakes/fake_pca9685.h"

namespace foldcar {

struct FeatherBench {
  FakePca9685 servo_chip;
  FakeLsm6dsox imu_chip;
  FeatherHal hal;

  // A new ESP32 whose LiPo has 3.8 V, with the servo driver's chip, and with the IMU's at its first address.
  explicit FeatherBench(bool with_imu = false) {
    fake_esp32 = {};
    fake_esp32.pin_mv[35] = 1900;
    fake_esp32.i2c.chips[0x40] = &servo_chip;
    if (with_imu) fake_esp32.i2c.chips[0x6A] = &imu_chip;
    imu_chip.acceleration_m_s2 = {0.0, 0.0, 9.81};
  }
  // As setup() does it, for an oscillator of that frequency (Hz).
  void begin(float oscillator_hz = 25e6f) {
    servo_chip.oscillator_hz = static_cast<double>(oscillator_hz);
    hal.begin(115200);
    hal.servos.set_oscillator_hz(oscillator_hz);
  }
};

struct BegunBench : FeatherBench {
  explicit BegunBench(bool with_imu = false) : FeatherBench(with_imu) { begin(); }
};

// The chip still drives from before a reset of the board, at 50 Hz and with auto-increment on.
inline void drive_from_before(FakePca9685& chip) {
  for (const std::vector<std::uint8_t>& bytes :
       {std::vector<std::uint8_t>{0x00, 0x10}, {0xFE, 121}, {0x00, 0x20}, {0x06, 0, 0, 0x4D, 0x01}}) {
    chip.write(bytes);
  }
  TEST_ASSERT_TRUE(chip.pulse_us(0) > 1000);
  chip.transmissions.clear();
  chip.has_driven = false;
}

// How long (ms) loop() stands still until the board restarts; 0 if it has not within 5 s.
inline std::uint32_t ms_until_restart() {
  for (std::uint32_t ms = 1; ms <= 5000; ++ms) {
    try {
      pass_fake_time(1000);
    } catch (const FakeRestart&) {
      return ms;
    }
  }
  return 0;
}

}  // namespace foldcar
