// The FS90R-like servo: pulse width to drive fraction, drive fraction and speed to torque and current.
#pragma once

#include "body_spec.h"

namespace foldcar {

// The command that a pulse stands for. Without pulses a servo is not powered: its motor gives no torque. Nor does a servo
// whose stall torque is 0: there is none.
struct ServoDrive {
  bool powered = false;
  double fraction = 0;  // of full speed, -1..1, positive drives the wheel forward
};

// The command of a pulse of pulse_us (µs; 0: no pulse): zero within the dead band, then linear up to full speed.
ServoDrive servo_drive(const ServoSpec& servo, double pulse_us);

// Torque on the wheel (N·m, positive drives forward) at wheel speed omega (rad/s): linear from stall torque to no-load
// speed, both proportional to the supply voltage, limited to the stall torque in either direction.
double servo_torque_n_m(const ServoSpec& servo, const ServoDrive& drive, double omega_rad_s, double supply_v);

// Current (A) drawn from the supply while the servo gives torque_n_m; none without a pulse.
double servo_current_a(const ServoSpec& servo, const ServoDrive& drive, double torque_n_m);

// The resistance (Ω) at which the supply's voltage would fall to a half if all servos drew the current at which they stall
// at the full voltage.
double largest_supply_resistance_ohm(const BodySpec& body);

// The supply of all servos of a car: cells of supply_v with an inner resistance R. The voltage of a step follows from the
// currents I of the step before, V = supply_v - R ΣI. R is at most largest_supply_resistance_ohm, so a change of V changes
// R ΣI by at most half as much, and V settles within a few steps.
class ServoSupply {
 public:
  // body must outlive it.
  explicit ServoSupply(const BodySpec& body) : body_(body), voltage_v_(body.supply_v) {}
  double voltage_v() const { return voltage_v_; }
  // A servo draws current_a in this step. Returns the power (W) that the cells give for it.
  double draw(double current_a);
  void end_step();

 private:
  const BodySpec& body_;
  double voltage_v_;
  double current_a_ = 0;  // of all servos in this step
};

}  // namespace foldcar
