// Wheel servos on the Servo FeatherWing: a PCA9685 at I2C address 0x40, eight outputs with pulses at 50 Hz.
//
// The chip runs by itself: a reset of the ESP32 leaves its outputs as they are, so begin() turns them off first of all.
#pragma once

#include <Adafruit_PWMServoDriver.h>

#include <cstdint>

#include "hal.h"
#include "output_gate.h"

namespace foldcar {

class FeatherServos : public WheelServos {
 public:
  FeatherServos();

  // Opens the I2C bus and turns every output off. Returns false if the chip does not acknowledge; every write fails then.
  bool begin();

  // Sets 50 Hz for a chip whose oscillator runs at that frequency (Hz; 23 to 27 MHz from chip to chip). Until then no
  // pulse can be written. Returns false if the chip does not confirm the rate within 1 Hz.
  bool set_oscillator_hz(float oscillator_hz);

  // From now on the driver's output enable, wired to the board, lets pulses through: docs/firmware.md. Returns false if it
  // cannot, and no pulse can be written then.
  bool use_output_enable() { return gate_.begin(); }

  bool write_pulses(const PulsesUs& pulses_us) override;

 private:
  bool write_off();
  // One transfer: a register's address and the bytes from there on.
  bool write(const std::uint8_t* bytes, std::size_t size);

  Adafruit_PWMServoDriver driver_;
  OutputGate gate_;
  bool bus_open_ = false;
  bool driver_begun_ = false;
  float us_per_tick_ = 0.0f;  // µs for each of the 4096 ticks of a period; 0 until the oscillator's frequency is set
};

}  // namespace foldcar
