// Model of the simulated car's IMU: computes its samples from the car's pose at successive steps.
#pragma once

#include <array>

#include "hal.h"
#include "sim_car.h"

namespace foldcar {

// Derives acceleration and angular rate from successive poses, with the sensor's low-pass filter.
class MotionSensor {
 public:
  // The sample after a step of step_s (s) that ends in this state; to be called at every step.
  ImuSample observe(const CarState& car, double step_s);

 private:
  struct Pose {
    std::array<double, 3> place_m{};
    std::array<double, 3> angles_rad{};  // heading, pitch, roll
  };

  // The number of poses so far, up to 2: a velocity needs two poses, an acceleration two velocities.
  int poses_ = 0;
  Pose last_;
  std::array<double, 3> velocity_m_s_{};
  ImuSample sample_;
};

}  // namespace foldcar
