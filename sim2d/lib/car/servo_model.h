// The FS90R-like servo: pulse width to drive fraction, drive fraction and speed to torque and current.
#pragma once

#include "body_spec.h"

namespace foldcar {

// What a pulse asks for. unpowered: no pulse, the motor is open and gives no torque.
struct ServoDrive {
  bool powered = false;
  double fraction = 0;  // of full speed, -1..1, positive drives the wheel forward
};

ServoDrive servo_drive(const ServoSpec& servo, double pulse_us);

// Torque on the wheel (N·m, positive drives forward) at wheel speed omega (rad/s): a line from stall torque
// to no-load speed, both in proportion to supply voltage, capped at stall torque in either direction.
double servo_torque_n_m(const ServoSpec& servo, const ServoDrive& drive, double omega_rad_s, double supply_v);

// Current (A) drawn from the supply while the servo gives torque_n_m; none without a pulse.
double servo_current_a(const ServoSpec& servo, const ServoDrive& drive, double torque_n_m);

}  // namespace foldcar
