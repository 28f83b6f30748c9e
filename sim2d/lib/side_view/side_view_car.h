// The simulated car in its side plane, in Box2D's world: segments are boxes, hinges revolute joints with limits, each pair
// of wheels a disc on a revolute joint whose motor is both servos.
//
// The plane goes through the start along its heading; roll, heading and sideways position stay those of the start, whatever
// the ground. Box2D finds the contacts and solves them with the joints (sequential impulses, 8 iterations of the
// velocities and 3 of the positions, as its manual advises) in single precision.
// Inputs: body, scene and terrain; then the servo pulses at every step. Output: the car's state. Rate: 240 Hz unless
// SideViewOptions says otherwise. The same inputs give the same states.
#pragma once

#include <box2d/box2d.h>

#include <array>
#include <cstddef>
#include <vector>

#include "body_spec.h"
#include "scene_spec.h"
#include "scoped_timer.h"
#include "servo_model.h"
#include "side_view_ground.h"
#include "sim_car.h"
#include "terrain.h"

namespace foldcar {

struct SideViewOptions {
  double rate_hz = 240;
  int velocity_iterations = 8;
  int position_iterations = 3;
  double drop_m = 0.0005;  // height over the ground at which the car is created
};

class SideViewCar : public SimCar, private b2ContactListener {
 public:
  // Puts the car down at the scene's start, level and at rest, on the part that touches first. body, scene, terrain and
  // stopwatch (may be null) must outlive the car. Throws std::runtime_error if a segment is more than 100 times as heavy
  // as a pair of wheels.
  SideViewCar(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain, const SideViewOptions& options,
              Stopwatch* stopwatch);

  void step(const PulsesUs& pulses_us) override;
  const CarState& state() const override { return state_; }
  double hinge_rad(std::size_t hinge) const override;
  bool finite() const override;
  double wheel_speed_rad_s(std::size_t wheel) const;  // positive drives forward
  // Sum of the normal forces on the pair that the wheel belongs to, in the last step.
  double pair_load_n(std::size_t wheel) const;
  // Kinetic and potential energy of all bodies, rotors included, and of the hinges' flexures.
  double mechanical_energy_j() const;

 private:
  // The left and the right wheels at one place: a disc and its joint, whose angle is that of the wheels backwards.
  struct Pair {
    // A wheel's servo in this step: its command, and what it would give at the wheels' rate at the start.
    struct Driven {
      const WheelSpec* wheel = nullptr;
      ServoDrive servo;
      double torque_n_m = 0;
    };
    std::array<Driven, 2> wheels;
    b2Body* disc = nullptr;
    b2RevoluteJoint* joint = nullptr;
    double grip = 0;         // the mean
    double start_rad_s = 0;  // wheels' rate at the start of this step
    // Of turn_rotors: both rotors' inertia, torques, how fast these follow, the segment's rate at the start of this step.
    double rotors_kg_m2 = 0, on_disc_n_m = 0, on_segment_n_m = 0, settling = 1, start_segment_rad_s = 0;
  };
  const Pair& pair_of(std::size_t wheel) const;
  void add_segments();
  void add_pair(const WheelSpec& left, const WheelSpec& right);
  void check_masses() const;
  void place_on_ground(double drop_m);
  void drive_wheels(const PulsesUs& pulses_us);
  void bend_hinges();
  template <typename Step>
  void turn_rotors(const Step& step);
  void count_energy();
  void update_state();
  // Sets the friction of a contact from the ground there and the part's grip.
  void PreSolve(b2Contact* contact, const b2Manifold* last) override;
  double friction_at(double x_m) const;

  const BodySpec& body_;
  const SceneSpec& scene_;
  const Terrain& terrain_;
  const SideViewOptions options_;
  const std::size_t main_;  // the main segment, to which the pose is fixed
  const double step_s_, reach_m_;
  Stopwatch* const stopwatch_;
  unsigned steps_ = 0;  // counted for the stopwatch only
  b2World world_;
  SideViewGround ground_;
  std::vector<b2Body*> segments_;
  std::vector<b2RevoluteJoint*> hinges_;
  std::vector<Pair> pairs_;
  ServoSupply supply_;
  CarState state_;
};

}  // namespace foldcar
