// A simulated car that runs the whole firmware, its link included: what `carsim link` offers on a port.
//
// Input: body, scene, design; then, between steps, bytes from a host and faults to inject. Output: the car's bytes. Time
// is that of the steps alone: the same inputs before the same steps give the same bytes.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "body_spec.h"
#include "ending.h"
#include "firmware.h"
#include "injection.h"
#include "line_noise.h"
#include "mavlink_packets.h"
#include "motion_sensor.h"
#include "scene_spec.h"
#include "scene_terrain.h"
#include "sim_hal.h"
#include "twin_track_car.h"

namespace foldcar {

struct LinkedCarOptions {
  DesignResult design;
  std::vector<std::pair<std::string, float>> stored_parameters;  // as if saved in flash before
  bool put_back = false;  // at the scene's start again whenever it is armed
};

class LinkedCar {
 public:
  // body and scene must outlive the car. firmware_id: 16 hexadecimal digits.
  LinkedCar(const BodySpec& body, const SceneSpec& scene, const LinkedCarOptions& options, std::string firmware_id);

  void receive(const std::vector<std::uint8_t>& bytes);
  void inject(const Injection& injection);
  // Advances by one step; the bytes that the car has sent in it. std::runtime_error if the simulation breaks down.
  std::vector<std::uint8_t> step();

  std::uint64_t now_us() const { return now_us_; }
  // Whether the cable is plugged in.
  bool plugged_in() const { return now_us_ >= unplugged_until_us_; }
  const PulsesUs& pulses_us() const { return hal_.servos.pulses_us(); }
  State state() const { return firmware_->application().status().state; }

 private:
  void put_down();
  void restart(ResetReason reason);
  void apply_faults();
  void watch_trial();
  void tell_truth();

  const BodySpec& body_;
  const SceneSpec& scene_;
  const LinkedCarOptions options_;
  const std::string firmware_id_;
  const SceneTerrain terrain_;
  SimHal hal_;
  std::unique_ptr<TwinTrackCar> car_;
  std::unique_ptr<Firmware> firmware_;
  MotionSensor motion_sensor_;
  LineNoise to_car_noise_{1}, from_car_noise_{2};
  std::uint64_t steps_ = 0;
  std::uint64_t now_us_ = 0;
  std::uint64_t booted_us_ = 0;  // when the firmware runs after a restart
  bool booting_ = false;
  std::uint64_t battery_until_us_ = 0, bus_until_us_ = 0, imu_until_us_ = 0;
  std::uint64_t unplugged_until_us_ = 0;
  State seen_state_ = State::kDisarmed;
  std::optional<Ending> ending_;
  double trial_started_s_ = 0;
  std::optional<Outcome> outcome_;
  double outcome_s_ = 0;
  std::uint64_t next_truth_us_ = 0;
  mavlink_status_t truth_numbering_{};
};

}  // namespace foldcar
