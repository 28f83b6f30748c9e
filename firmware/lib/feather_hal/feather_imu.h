// An optional IMU on the servo wing's I2C bus: ST LSM6DSOX at address 0x6A or 0x6B, mounted with x forward, y left, z up.
#pragma once

#include <Adafruit_I2CDevice.h>

#include "hal.h"

namespace foldcar {

class FeatherImu : public Imu {
 public:
  FeatherImu();

  // Looks for the IMU on the bus, which must be open, and sets ranges and rate. Returns false if there is none.
  bool begin();

  bool present() const override { return device_ != nullptr; }
  bool read(ImuSample& sample) override;

 private:
  Adafruit_I2CDevice at_6a_, at_6b_;
  Adafruit_I2CDevice* device_ = nullptr;  // the one that answered
};

}  // namespace foldcar
