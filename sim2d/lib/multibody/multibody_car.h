// The simulated car: rigid bodies with six degrees of freedom, hinges and wheels on outlines of the ground along its
// heading, in fixed time steps.
//
// Inputs: body, friction coefficient, terrain and pose; then the servo pulses at every step. Output: the car's state.
// Rate: 240 Hz unless StepOptions says otherwise. There is no randomness and no clock: the same inputs give the same
// states.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "body_spec.h"
#include "car_constants.h"
#include "car_dynamics.h"
#include "contact_search.h"
#include "contact_solver.h"
#include "hal.h"
#include "scene_spec.h"
#include "scoped_timer.h"
#include "servo_model.h"
#include "sim_car.h"
#include "track_terrain.h"

namespace foldcar {

// Rate and solver settings of the steps.
struct StepOptions {
  double rate_hz = 240;
  int iterations = 40;     // of the contact solver, at most
  double drop_m = 0.0005;  // height over the ground at which the car is created
};

// One car on its terrain.
class MultibodyCar : public SimCar {
 public:
  // Puts the car down at start, wheels on the ground, at rest. friction is the coefficient outside patches. body,
  // terrain and stopwatch (may be null) must outlive the car.
  MultibodyCar(const BodySpec& body, double friction, const Terrain& terrain, const PoseSpec& start,
               const StepOptions& options, Stopwatch* stopwatch);

  void step(const PulsesUs& pulses_us) override;
  const CarState& state() const override { return state_; }
  double step_s() const { return step_s_; }
  double wheel_speed_rad_s(std::size_t wheel) const;  // positive drives forward
  double wheel_load_n(std::size_t wheel) const;       // sum of the normal forces in the last step
  double hinge_rad(std::size_t hinge) const override { return car_.hinge_rad[hinge]; }
  // Kinetic and potential energy of all bodies, rotors included, and of the hinges' flexures.
  double mechanical_energy_j() const { return car_.mechanical_energy_j(); }
  bool finite() const override;
  // Pose and velocities, to be set to those that a test starts from.
  CarDynamics& dynamics() { return car_; }

 private:
  void place_on_ground(const PoseSpec& start, double drop_m);
  // The lowest height of the car's origin at which none of the contacts that count overlaps.
  template <typename Counts>
  double lowest_m(const Counts& counts);
  CutPose cut_pose() const;
  void cut_terrain_if_stale();
  void drive_wheels(const PulsesUs& pulses_us);
  void find_contacts();
  void count_energy(const PulsesUs& pulses_us);
  void update_state();

  const BodySpec& body_;
  const std::size_t main_;  // the main segment, to which the pose is fixed
  const double friction_;   // coefficient outside patches
  const Terrain& terrain_;
  const CarConstants constants_;
  const double step_s_;
  Stopwatch* const stopwatch_;
  unsigned steps_ = 0;  // counted for the stopwatch only
  std::optional<TrackTerrain> ground_;  // if the terrain has smooth ground
  CarDynamics car_;
  ContactSearch search_;
  const std::unique_ptr<ContactSolver> solver_;
  std::vector<Contact> contacts_, last_contacts_;
  std::vector<double> torque_n_m_, damping_, start_rad_s_;  // of each wheel in this step
  ServoSupply supply_;
  double path_m_ = 0;  // way of the main segment's centre of mass along its heading
  CarState state_;
};

}  // namespace foldcar
