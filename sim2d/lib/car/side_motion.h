// Sliding sideways, rolling and turning, which the side view does not see: what the ground's friction across the car's
// heading does to its sideways speed and its yaw rate, and the couple that it puts on roll.
//
// Inputs, after each step of the plane: the contacts with their impulses, and the plane's own rates. Outputs: the yaw
// rate, the sideways speed, a couple on roll, and for each contact how its friction is shared. No Box2D.
//
// Coordinates are the centre of mass' sideways speed u, roll (about the car's pitched forward axis) and heading:
//   kinetic energy = m/2 u^2 + I_x/2 (roll' + yaw' sin pitch)^2 + I_z/2 (yaw' cos pitch)^2
// Signs as everywhere: left, left side up, to the left; forward.
#pragma once

#include <vector>

namespace foldcar {

struct GroundContact {
  // Place from the centre of mass; depth is along the car's own z.
  double ahead_m = 0;
  double left_m = 0;
  double depth_m = 0;
  double limit_n_s = 0;     // friction times the step's normal impulse
  double tangent_n_s = 0;   // friction's impulse on the car in the plane, as the plane's solver left it
  double tangent_x = 1;     // forward share of the direction it is counted in
  double slip_m_s = 0;      // of the ground against the car, in that direction
  double slip_mass_kg = 0;  // of a wheel: that an impulse in that direction moves; 0 for a belly, dragged on anyway
  double push_n_s = 0;      // of ground that falls to a side, to the left
  // Results.
  double side_n_s = 0;          // impulse of friction on the car, to the left
  double kept_tangent_n_s = 0;  // what the friction circle leaves of tangent_n_s
};

// What the plane's step ended with.
struct PlaneRates {
  double pitch_rad = 0;
  double speed_m_s = 0;
  double roll_rate_rad_s = 0;
  double roll_inertia_kg_m2 = 0;  // that the plane rolled with, which may be more than the car's own
  double yaw_rate_rad_s = 0;
  double grip_n_m_s = 0;    // of yaw_rate, the angular impulse that already came from friction across
};

// Of the car, about axes through its centre of mass.
struct SideInertia {
  double mass_kg;
  double com_height_m;
  double roll_kg_m2;
  double yaw_kg_m2;
};

class SideMotion {
 public:
  explicit SideMotion(const SideInertia& car) : car_(car) {}

  // Shares every contact's friction between its two directions and advances the state.
  void step(double step_s, const PlaneRates& plane, std::vector<GroundContact>& contacts);

  double yaw_rate_rad_s() const { return yaw_rate_rad_s_; }
  double side_speed_m_s() const { return side_speed_m_s_; }    // of the ground point below the centre of mass
  double roll_couple_n_m() const { return roll_couple_n_m_; }  // to act in the next step
  double grip_n_m() const { return grip_n_m_; }                // couple of friction across against yaw
  // Inertia against a change of heading of the car pitched so.
  double heading_inertia_kg_m2(double pitch_rad) const;

 private:
  const SideInertia car_;
  double drift_m_s_ = 0;  // of the centre of mass
  double side_speed_m_s_ = 0, yaw_rate_rad_s_ = 0, roll_couple_n_m_ = 0, grip_n_m_ = 0;
  double given_n_m_s_ = 0;  // angular impulse that the plane was given for the friction of the step that comes
  double roll_rate_rad_s_ = 0, roll_on_yaw_rad_s_ = 0, yaw_on_roll_rad_s_ = 0;  // of the last step
};

}  // namespace foldcar
