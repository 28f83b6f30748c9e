// A car as the simulator takes it: what docs/carsim.md calls a body, in SI units.
#pragma once

#include <string>
#include <vector>

namespace foldcar {

// A continuous-rotation servo: a torque-speed line at rated_v and the pulses that command it.
struct ServoSpec {
  double stall_torque_n_m = 0;
  double no_load_speed_rad_s = 0;
  double rated_v = 0;
  double stall_current_a = 0;
  double no_load_current_a = 0;
  double rotor_inertia_kg_m2 = 0;  // at the output shaft
  double neutral_us = 0;
  double deadband_us = 0;
  double saturation_us = 0;  // distance from neutral at which the command is full
  int direction = 1;         // +1: a pulse above neutral drives the wheel forward
};

enum class CarSide { kLeft = 0, kRight = 1 };

struct WheelSpec {
  int channel = 0;
  CarSide side = CarSide::kLeft;
  double x_m = 0;
  double radius_m = 0;
  double width_m = 0;
  double mass_kg = 0;
  double grip = 1;
  ServoSpec servo;
};

// The box between the wheels with all it carries; inertias about its own centre of mass.
struct ChassisSpec {
  double length_m = 0;
  double width_m = 0;
  double height_m = 0;
  double center_z_m = 0;
  double mass_kg = 0;
  double com_x_m = 0;
  double com_z_m = 0;
  double roll_inertia_kg_m2 = 0;
  double pitch_inertia_kg_m2 = 0;
  double yaw_inertia_kg_m2 = 0;
  double grip = 0;
};

struct BodySpec {
  std::string id;
  ChassisSpec chassis;
  double track_m = 0;
  std::vector<WheelSpec> wheels;
  double supply_v = 0;
};

}  // namespace foldcar
