// An optional IMU on the servo wing's I2C bus: ST LSM6DSOX at address 0x6A or 0x6B.
//
// It is mounted with its x axis forward, y to the left and z up.
#pragma once

#include <Adafruit_I2CDevice.h>

#include "hal.h"

namespace foldcar {

class FeatherImu : public Imu {
 public:
  FeatherImu();

  // Looks for it on the bus, which must be open. False if there is none.
  bool begin();

  bool present() const override { return device_ != nullptr; }
  bool read(ImuSample& sample) override;

 private:
  Adafruit_I2CDevice at_6a_, at_6b_;
  Adafruit_I2CDevice* device_ = nullptr;
};

}  // namespace foldcar
