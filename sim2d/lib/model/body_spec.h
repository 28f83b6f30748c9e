// A car as the simulator takes it: what docs/carsim.md calls a body, in SI units.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace foldcar {

constexpr double kGravity_m_s2 = 9.81;
constexpr double kContactTime_s = 0.005;

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

// The side of the car that a wheel is on.
enum class CarSide { kLeft = 0, kRight = 1 };

// A wheel on its servo, or without one, which turns freely; x_m is that of the axle, ahead of the car's origin.
struct WheelSpec {
  int channel = 0;  // the servo's output; without a servo a number that no other wheel has
  int segment = 0;  // index into the body's segments
  CarSide side = CarSide::kLeft;
  double x_m = 0;
  double radius_m = 0;
  double width_m = 0;
  double mass_kg = 0;
  double grip = 1;  // factor on the ground's friction coefficient
  // The tyre's centre lies this far from the axle, at the start in the direction phase (from forward through up).
  double eccentricity_m = 0;
  double eccentricity_phase_rad = 0;
  // The next two are MuJoCo's only, see check_plain_tyres. Camber as in ISO 8855: positive with the wheel's top outwards.
  double camber_rad = 0;
  double contact_time_s = kContactTime_s;  // time constant of the tyre's contacts
  ServoSpec servo;                         // all 0 without a servo
  bool driven() const { return servo.stall_torque_n_m > 0; }
};

// A rigid box between wheels with all it carries; inertias about its own centre of mass.
struct SegmentSpec {
  double x_m = 0;  // of the box' middle
  double length_m = 0;
  double width_m = 0;
  double height_m = 0;
  double center_z_m = 0;
  double mass_kg = 0;
  double com_x_m = 0;
  double com_y_m = 0;
  double com_z_m = 0;
  double roll_inertia_kg_m2 = 0;
  double pitch_inertia_kg_m2 = 0;
  double yaw_inertia_kg_m2 = 0;
  double grip = 0;  // factor on the ground's friction coefficient, of the belly
};

// A pitch joint between a segment and the next: flat at 0, positive with the front one's nose up against the rear one.
struct HingeSpec {
  double x_m = 0;
  double z_m = 0;
  double stiffness_n_m_rad = 0;
  double damping_n_m_s_rad = 0;
  double min_rad = 0;
  double max_rad = 0;
};

// A whole car: segments, hinges and wheels, and the voltage of the servo supply.
struct BodySpec {
  std::string id;
  std::vector<SegmentSpec> segments;  // front to back
  std::vector<HingeSpec> hinges;      // hinges[j] joins segments j and j + 1
  double track_m = 0;
  std::vector<WheelSpec> wheels;
  double supply_v = 0;               // without a load
  double supply_resistance_ohm = 0;  // of cells, wires and switch together
};

// The segment that stands for the whole car's pose: whose box contains x = 0 or comes nearest to it, the front one
// of two.
std::size_t main_segment(const BodySpec& body);

// Throws std::runtime_error that names the key if a tyre leans or is as soft as only MuJoCo models it. engine: who asks.
void check_plain_tyres(const BodySpec& body, const std::string& engine);

}  // namespace foldcar
