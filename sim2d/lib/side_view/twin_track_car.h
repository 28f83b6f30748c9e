// The simulated car: a side view of two tracks in Box2D, with roll, yaw and lateral motion added, in fixed time steps.
//
// Inputs: body, friction coefficient, terrain and pose; then the servo pulses at every step. Output: the car's state.
// Rate: 240 Hz unless StepOptions says otherwise. There is no randomness and no clock: the same inputs give the same
// states.
#pragma once

#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "body_spec.h"
#include "hal.h"
#include "mechanism.h"
#include "scene_spec.h"
#include "servo_model.h"
#include "lateral_dynamics.h"
#include "side_view_terms.h"
#include "scoped_timer.h"
#include "sim_car.h"
#include "track_terrain.h"

namespace foldcar {

// Rate and solver settings of the steps.
struct StepOptions {
  double rate_hz = 240;
  int velocity_iterations = 8;
  int impact_iterations = 24;  // velocity iterations of a step that follows an impact
  int position_iterations = 1;
  double drop_m = 0.0005;      // height over the ground from which the car is put down, so that its contacts form
};

// One car on its terrain, in a Box2D world of its own.
class TwinTrackCar : public SimCar {
 public:
  // Puts the car down at start, wheels on the ground, at rest. friction is the coefficient outside patches. body,
  // terrain and stopwatch (may be null) must outlive the car.
  TwinTrackCar(const BodySpec& body, double friction, const Terrain& terrain, const PoseSpec& start,
               const StepOptions& options, Stopwatch* stopwatch);

  void step(const PulsesUs& pulses_us) override;
  const CarState& state() const override { return state_; }
  double step_s() const { return step_s_; }
  double wheel_speed_rad_s(std::size_t wheel) const;  // positive drives forward
  double wheel_load_n(std::size_t wheel) const { return wheels_[wheel].load_n; }  // normal force in the last step
  double hinge_rad(std::size_t hinge) const override;
  // Kinetic and potential energy of all bodies of the plane and of the hinges' flexures.
  double mechanical_energy_j() const;
  bool finite() const override;

 private:
  struct WheelState {
    double speed_rad_s = 0;
    double acceleration_rad_s2 = 0;  // low-pass filtered
    double load_n = 0;               // sum of the normal forces
    double friction = 0;             // coefficient of the ground under it
    b2ManifoldPoint* support = nullptr;  // its only contact point; null with none or several
    double slip_mass_kg = 0;  // effective mass against a tangential impulse: car and wheel spin in series
  };

  void put_down(const PoseSpec& start);
  void cut_terrain_if_stale();
  void drive_wheels(const PulsesUs& pulses_us);
  void apply_roll_couples();
  void apply_yaw_couples();
  void advance_pose();
  void read_contacts();
  // The segment whose chassis is one of two bodies in contact, if any.
  std::optional<std::size_t> belly_of(const b2Body* a, const b2Body* b) const;
  // Friction coefficient of the ground at s_m of the plane, y_m to the left of the car's middle.
  double friction_at(double s_m, double y_m) const;
  void update_wheel_friction(std::size_t wheel, double s_m);
  void update_belly_friction();
  void resolve_friction();
  void balance_axle_loads();
  void read_tyre(std::size_t wheel, b2Contact& contact);
  void read_belly(std::size_t segment, b2Contact& contact);
  // A contact point of the last step with the impulses and mean forces on the car's body.
  struct ContactPoint {
    b2Body* body;
    b2Vec2 position, normal, tangent;  // in the plane, Box2D's units; the normal points into the body
    double z_m;
    double normal_n_s, tangent_n_s;
    double forward_n, up_n;
  };
  ContactPoint contact_point(b2Body& body, b2Contact& contact, int point) const;
  // Adds a contact left_m to the left of the centre of mass; track is the one under a wheel, null for a belly.
  GroundContact& add_contact(const ContactPoint& point, const b2Body* track, double left_m, double friction);
  b2Vec2 chassis_velocity() const;  // of the main segment's centre of mass, m/s
  void update_state();

  const BodySpec& body_;
  const SegmentSpec& main_;  // the main segment, to which the pose is fixed
  const double friction_;    // coefficient outside patches
  const Terrain& terrain_;
  const CarConstants constants_;
  const StepOptions options_;
  const double step_s_;
  Stopwatch* const stopwatch_;
  unsigned steps_ = 0;  // counted for the stopwatch only
  b2World world_;
  TrackTerrain ground_;
  LateralDynamics lateral_;
  double track_inertia_kg_m2_;  // yaw inertia that the tracks' mass represents
  Mechanism car_;
  std::vector<WheelState> wheels_;
  std::vector<std::pair<std::size_t, std::size_t>> axles_;  // left and right wheel of each

  // Gains of the low-pass filters per step.
  double rotor_gain_, yaw_rate_gain_;

  // Pose of the main segment's centre of mass in the world, and the positions in the plane up to which it is
  // integrated.
  double com_x_m_ = 0, com_y_m_ = 0, heading_rad_ = 0;
  double last_s_m_ = 0, last_yaw_m_ = 0;
  double track_error_m_ = 0;   // difference of the tracks' positions that the heading asks for, less their own
  double yaw_rate_rad_s_ = 0;  // low-pass filtered

  // The contacts of the last step, the same in both lists.
  std::vector<GroundContact> contacts_;
  std::vector<ContactPoint> contact_points_;
  CarriedLoad load_;
  double contact_yaw_n_m_ = 0;  // yaw couple of the forward contact forces that act beside the centre of mass
  bool impact_ = false;         // wheel loads of the last step were those of an impact
  CarState state_;
};

}  // namespace foldcar
