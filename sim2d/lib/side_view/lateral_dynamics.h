// Lateral dynamics: sideways velocity, roll and yaw under the lateral friction of the contacts.
//
// The plane of Box2D (mechanism.h) holds the motion along the heading, pitch and roll. This class adds what the plane
// has no coordinate for. Inputs, after each step of the plane: the contacts with their impulses, and the plane's rates.
// Outputs: the yaw rate, the lateral speed, a couple on roll for the next step, and for each contact how its friction
// is shared between its two directions. Does not use Box2D.
//
// Generalised coordinates are the lateral velocity u of the centre of mass, roll (about the car's pitched forward axis)
// and heading, with the kinetic energy
//   m/2 u² + I_x/2 (roll' + yaw' sin pitch)² + I_z/2 (yaw' cos pitch)²
// Signs: u to the left, roll left side up, yaw to the left, impulses forward and to the left. SI units.
#pragma once

#include <vector>

namespace foldcar {

// A contact point of the car with the ground in one step of the plane.
struct GroundContact {
  // Position from the centre of mass: along the heading, to the left, and down along the car's own z axis (m).
  double ahead_m = 0;
  double left_m = 0;
  double depth_m = 0;
  double limit_n_s = 0;        // largest friction impulse: coefficient times the step's normal impulse
  double tangent_n_s = 0;      // friction impulse on the car in the plane, as Box2D's solver left it
  double tangent_forward = 1;  // forward component of the unit tangent that tangent_n_s and slip_m_s refer to
  double slip_m_s = 0;         // velocity of the ground relative to the car along the tangent
  double slip_mass_kg = 0;     // of a wheel: effective mass against an impulse along the tangent; 0 for a belly
  double slope_n_s = 0;        // lateral component of the normal impulse of ground that slopes to a side
  // Results.
  double lateral_n_s = 0;          // friction impulse on the car to the left
  double limited_tangent_n_s = 0;  // what the friction circle leaves of tangent_n_s
};

// The plane's state at the end of its step.
struct PlaneRates {
  double pitch_rad = 0;
  double speed_m_s = 0;  // along the heading
  double roll_rate_rad_s = 0;
  double roll_inertia_kg_m2 = 0;  // roll inertia in the plane, which may exceed the car's own
  double yaw_rate_rad_s = 0;
  double scrub_n_m_s = 0;  // angular impulse about the vertical with which the plane anticipated lateral friction
};

// Inertia of the whole car, moments about axes through its centre of mass.
struct LateralInertia {
  double mass_kg;
  double com_height_m;  // centre of mass over the contacts, car level
  double roll_kg_m2;
  double yaw_kg_m2;
};

// The state of the lateral motion, advanced once a step.
class LateralDynamics {
 public:
  explicit LateralDynamics(const LateralInertia& car) : car_(car) {}

  // Fills the results of every contact and advances the state by step_s.
  void step(double step_s, const PlaneRates& plane, std::vector<GroundContact>& contacts);

  double yaw_rate_rad_s() const { return yaw_rate_rad_s_; }
  // Lateral velocity of the point of the car at ground height below the centre of mass.
  double lateral_speed_m_s() const { return lateral_speed_m_s_; }
  // Couple about the roll axis, to be applied during the next step.
  double roll_couple_n_m() const { return roll_couple_n_m_; }
  // Magnitude of the couple about the vertical of lateral friction in the last step: scrub, which resists a turn.
  double scrub_n_m() const { return scrub_n_m_; }
  // Moment of inertia about the vertical of the car at that pitch.
  double heading_inertia_kg_m2(double pitch_rad) const;

 private:
  const LateralInertia car_;
  double com_lateral_m_s_ = 0;  // lateral velocity of the centre of mass
  double lateral_speed_m_s_ = 0, yaw_rate_rad_s_ = 0, roll_couple_n_m_ = 0, scrub_n_m_ = 0;
  double roll_impulse_n_m_s_ = 0;  // part of roll_couple_n_m_ over one step that the plane applies in advance
  // Of the last step: the roll rate, its component about the vertical, and that of the yaw rate about the forward axis.
  double roll_rate_rad_s_ = 0, roll_about_vertical_rad_s_ = 0, yaw_about_forward_rad_s_ = 0;
};

}  // namespace foldcar
