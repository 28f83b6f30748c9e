// The simulated car: a Box2D side view of two tracks plus the couples of width, advanced in fixed steps.
//
// Inputs: a body, a friction, a terrain, a pose; then the servo pulses at every step. Output: where the car is.
// Rate: 240 Hz unless asked otherwise. No randomness, no clock: same inputs, same states.
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
#include "side_motion.h"
#include "side_view_terms.h"
#include "stopwatch.h"
#include "track_terrain.h"

namespace foldcar {

struct StepOptions {
  double rate_hz = 240;
  int velocity_iterations = 8;
  int struck_iterations = 24;  // while wheels are pressed hard
  int position_iterations = 1;
  double drop_m = 0.0005;  // the car is put down from this height, so that contact is found by falling
};

// Pose of the car's origin (middle of the length, axle height), carried by the main segment, and what it has spent.
struct CarState {
  double x_m = 0, y_m = 0, z_m = 0;
  double heading_rad = 0, pitch_rad = 0, roll_rad = 0;
  double speed_m_s = 0;      // along the heading
  double yaw_rate_rad_s = 0;
  double up = 1;             // cosine of the angle between the car's up axis and the vertical
  double consumed_energy_j = 0;
  double motor_work_j = 0;
};

class TwinTrackCar {
 public:
  TwinTrackCar(const BodySpec& body, double friction, const Terrain& terrain, const PoseSpec& start,
               const StepOptions& options, Stopwatch* stopwatch);

  // Advances one step with these pulses on the servo outputs.
  void step(const PulsesUs& pulses_us);

  const CarState& state() const { return state_; }
  double step_s() const { return step_s_; }
  double wheel_speed_rad_s(std::size_t wheel) const;  // positive drives forward
  double wheel_load_n(std::size_t wheel) const { return wheels_[wheel].load_n; }  // of the last step
  double hinge_rad(std::size_t hinge) const;           // as HingeSpec counts it
  // Kinetic and potential energy of everything that moves and of the hinges' flexures, J.
  double mechanical_energy_j() const;
  // False once any state is not a finite number.
  bool finite() const;

 private:
  struct WheelState {
    double speed_rad_s = 0;
    double acceleration_rad_s2 = 0;  // filtered
    double load_n = 0;
    double friction = 0;             // of the ground under it
    b2ManifoldPoint* support = nullptr;  // what carries it, if that is one point
    double slip_mass_kg = 0;         // that a push along the ground moves, the car and the wheel's spin
  };

  void put_down(const PoseSpec& start);
  void cut_terrain_if_stale();
  void drive_wheels(const PulsesUs& pulses_us);
  void apply_roll_couples();
  void apply_yaw_couples();
  void advance_pose();
  void read_contacts();
  // The segment whose belly is one of two bodies in contact.
  std::optional<std::size_t> belly_of(const b2Body* a, const b2Body* b) const;
  // Friction of the ground at a place of the plane, y across the car.
  double friction_at(double s_m, double y_m) const;
  void take_friction(std::size_t wheel, double s_m);
  void take_belly_friction();
  void share_friction();
  void untwist_loads();
  void read_tyre(std::size_t wheel, b2Contact& contact);
  void read_belly(std::size_t segment, b2Contact& contact);
  // A contact point of the last step.
  struct Touch {
    b2Body* body;
    b2Vec2 place, normal, tangent;  // in the plane; the normal into the body
    double z_m;
    double normal_n_s, tangent_n_s;
    double forward_n, up_n;  // on the body
  };
  Touch touch_of(b2Body& body, b2Contact& contact, int point) const;
  // left_m from the centre of mass; the track that a wheel's contact is felt on.
  GroundContact& enter_contact(const Touch& touch, const b2Body* track, double left_m, double friction);
  b2Vec2 chassis_velocity() const;  // m/s, of the main segment's centre of mass
  void update_state();

  const BodySpec& body_;
  const SegmentSpec& main_;  // carries the pose; its centre of mass is followed through the plane
  const double friction_;  // outside patches
  const Terrain& terrain_;
  const CarConstants constants_;
  const StepOptions options_;
  const double step_s_;
  Stopwatch* const stopwatch_;
  unsigned steps_ = 0;  // counted for the stopwatch only
  b2World world_;
  TrackTerrain ground_;
  SideMotion side_;
  double track_inertia_kg_m2_;  // that the tracks' mass was last set for
  Mechanism car_;
  std::vector<WheelState> wheels_;
  std::vector<std::pair<std::size_t, std::size_t>> axles_;  // left and right wheels of one place

  // Filters' gains a step, from their time constants.
  double rotor_gain_, yaw_rate_gain_;

  // Pose of the centre of mass in the world, and what of the plane it has been integrated from.
  double com_x_m_ = 0, com_y_m_ = 0, heading_rad_ = 0;
  double last_s_m_ = 0, last_yaw_m_ = 0;
  double track_error_m_ = 0;  // how much further apart the tracks should stand
  double yaw_rate_rad_s_ = 0;  // filtered

  // The contacts of the last step, and where in the plane each acts on the car.
  std::vector<GroundContact> contacts_;
  std::vector<Touch> touching_;
  CarriedLoad load_;
  double contact_yaw_n_m_ = 0;  // couple of what pulls beside the centre of mass
  bool struck_ = false;         // the last step pressed wheels hard
  CarState state_;
};

}  // namespace foldcar
