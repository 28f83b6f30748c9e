// A simulated car as trials see it: it takes the servos' pulses, advances in fixed steps and tells where it is.
//
// The firmware, its HAL, the servo model, trials and endings are the same whatever moves the car behind this interface.
#pragma once

#include <cstddef>

#include "hal.h"

namespace foldcar {

// Pose of the car's origin (middle of the length, axle height), which is fixed to the main segment, and energies since
// the car was put down.
struct CarState {
  double x_m = 0, y_m = 0, z_m = 0;
  double heading_rad = 0, pitch_rad = 0, roll_rad = 0;  // the heading counts whole turns
  double speed_m_s = 0;                                 // along the heading
  double yaw_rate_rad_s = 0;
  double up = 1;                 // cosine of the angle between the car's up axis and the vertical
  double consumed_energy_j = 0;  // electrical energy from the servo supply
  double motor_work_j = 0;       // mechanical work of the servos
};

// One car on its ground.
class SimCar {
 public:
  virtual ~SimCar() = default;
  // Advances one step with these pulses (µs) on the servo outputs.
  virtual void step(const PulsesUs& pulses_us) = 0;
  virtual const CarState& state() const = 0;
  // Angle of a hinge; positive as HingeSpec says.
  virtual double hinge_rad(std::size_t hinge) const = 0;
  // False once any state is not a finite number.
  virtual bool finite() const = 0;
};

}  // namespace foldcar
