// The simulated car in three dimensions: rigid bodies, tyres as cylinders and frictional contacts, solved by MuJoCo.
//
// Inputs: body, scene and its terrain; then the servo pulses at every step. Output: the car's state. There is no
// randomness and no clock: the same inputs give the same states.
#pragma once

#include <mujoco/mujoco.h>

#include <cstddef>
#include <memory>

#include "body_spec.h"
#include "hal.h"
#include "mujoco_model.h"
#include "scene_spec.h"
#include "scoped_timer.h"
#include "servo_model.h"
#include "sim_car.h"
#include "terrain.h"

namespace foldcar {

struct DeleteData {
  void operator()(mjData* data) const { mj_deleteData(data); }
};

// Removes the lift that MuJoCo adds to the normal force of a contact that slips (reason and formula: mujoco_car.cpp).
// To be called between mj_step1 and mj_step2.
void cancel_lift_of_slip(mjData& data);

// The car as a MuJoCo model: step() sets the servos' torque lines from the pulses, lets MuJoCo advance by one step and
// reads the car's state. The pose is that of the main segment.
class MujocoCar : public SimCar {
 public:
  // Builds the model and puts the car down, level, at the scene's start. body, scene, terrain and stopwatch (may be
  // null) must outlive it. Throws std::runtime_error if MuJoCo refuses the model.
  MujocoCar(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain, const MujocoOptions& options,
            Stopwatch* stopwatch);

  void step(const PulsesUs& pulses_us) override;
  const CarState& state() const override { return state_; }
  double hinge_rad(std::size_t hinge) const override;
  bool finite() const override;

  double wheel_speed_rad_s(std::size_t wheel) const;
  // Kinetic and potential energy of all bodies and of the hinges' flexures.
  double mechanical_energy_j();
  const mjModel& model() const { return *built_.model; }
  mjData& data() { return *data_; }

 private:
  void place_on_ground();
  void take_friction();
  void drive_wheels(const PulsesUs& pulses_us);
  void count_energy();
  void update_state();

  const BodySpec& body_;
  const SceneSpec& scene_;
  const Terrain& terrain_;
  Stopwatch* const stopwatch_;
  MujocoModel built_;
  std::unique_ptr<mjData, DeleteData> data_;
  PulsesUs pulses_us_{};
  ServoSupply supply_;
  unsigned steps_ = 0;  // counted for the stopwatch only
  CarState state_;
};

}  // namespace foldcar
