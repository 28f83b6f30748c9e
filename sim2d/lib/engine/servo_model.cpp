#include "servo_model.h"

#include <algorithm>
#include <cmath>

namespace foldcar {

ServoDrive servo_drive(const ServoSpec& servo, double pulse_us) {
  if (pulse_us <= 0 || servo.stall_torque_n_m == 0) return {false, 0};
  const double offset_us = servo.direction * (pulse_us - servo.neutral_us);
  const double excess_us = std::abs(offset_us) - servo.deadband_us;
  if (excess_us <= 0) return {true, 0};
  const double fraction = std::min(1.0, excess_us / (servo.saturation_us - servo.deadband_us));
  return {true, std::copysign(fraction, offset_us)};
}

double servo_torque_n_m(const ServoSpec& servo, const ServoDrive& drive, double omega_rad_s, double supply_v) {
  if (!drive.powered) return 0;
  const double stall_n_m = servo.stall_torque_n_m * supply_v / servo.rated_v;
  const double no_load_rad_s = servo.no_load_speed_rad_s * supply_v / servo.rated_v;
  return std::clamp(stall_n_m * (drive.fraction - omega_rad_s / no_load_rad_s), -stall_n_m, stall_n_m);
}

double servo_current_a(const ServoSpec& servo, const ServoDrive& drive, double torque_n_m) {
  if (!drive.powered) return 0;
  const double per_torque = (servo.stall_current_a - servo.no_load_current_a) / servo.stall_torque_n_m;
  return servo.no_load_current_a * std::abs(drive.fraction) + per_torque * std::abs(torque_n_m);
}

double largest_supply_resistance_ohm(const BodySpec& body) {
  double stall_a = 0;
  for (const WheelSpec& wheel : body.wheels) {
    if (!wheel.driven()) continue;
    const ServoSpec& servo = wheel.servo;
    // The stall torque, and with it this part of the current, is proportional to the voltage.
    const double torque_current_a = servo.stall_current_a - servo.no_load_current_a;
    stall_a += servo.no_load_current_a + torque_current_a * body.supply_v / servo.rated_v;
  }
  // Without driven wheels any resistance is possible.
  return stall_a > 0 ? 0.5 * body.supply_v / stall_a : 1e3;
}

double ServoSupply::draw(double current_a) {
  current_a_ += current_a;
  return body_.supply_v * current_a;
}

void ServoSupply::end_step() {
  voltage_v_ = std::max(0.5 * body_.supply_v, body_.supply_v - body_.supply_resistance_ohm * current_a_);
  current_a_ = 0;
}

}  // namespace foldcar
