// Wheel servos on the Servo FeatherWing: a PCA9685 at I2C address 0x40, eight outputs of 50 Hz pulses.
//
// The chip runs on its own: a reset of the board leaves its outputs as they are. begin() therefore turns them
// off before it does anything else.
#pragma once

#include <Adafruit_PWMServoDriver.h>

#include "hal.h"

namespace foldcar {

class FeatherServos : public WheelServos {
 public:
  FeatherServos();

  // Opens the bus with every output off. False if the chip does not answer; every write fails then.
  bool begin();

  // Sets 50 Hz by the chip's true oscillator frequency (23 to 27 MHz, from chip to chip). Needed before any
  // pulse can be written. False if the chip does not confirm it.
  bool set_oscillator_hz(float oscillator_hz);

  bool write_pulses(const PulsesUs& pulses_us) override;

 private:
  bool write_off();

  Adafruit_PWMServoDriver driver_;
  bool bus_open_ = false;
  bool driver_begun_ = false;
  float us_per_tick_ = 0.0f;  // 0 until the oscillator is known
};

}  // namespace foldcar
