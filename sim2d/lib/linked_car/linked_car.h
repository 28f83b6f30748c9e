// A simulated car with the whole firmware, its MAVLink connection included: the car that `carsim link` offers on a port.
//
// Input: worlds (a body in a scene each), design; then, between steps, bytes from a host and faults. Output: the car's
// bytes. Only step() advances time: the same input before the same steps gives the same output. A disarmed car moves to
// another of its worlds when a host names the scene in a FOLDCAR_SCENE message.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "body_spec.h"
#include "engine.h"
#include "ending.h"
#include "firmware.h"
#include "injection.h"
#include "line_noise.h"
#include "mavlink_packets.h"
#include "motion_sensor.h"
#include "program_run.h"
#include "scene_spec.h"
#include "scene_terrain.h"
#include "sim_hal.h"

namespace foldcar {

// design: as in the car's car.json.
struct LinkedCarOptions {
  DesignResult design;
  std::vector<std::pair<std::string, float>> stored_parameters;  // name and value, as if stored in flash
  bool put_back = false;  // whether the car returns to the scene's start whenever it is armed
};

// A scene, and the car as it is there: built cars may differ from sample to sample.
struct LinkedWorld {
  BodySpec body;
  SceneSpec scene;
};

class LinkedCar {
 public:
  // The car begins in the first of worlds. engine and worlds must outlive the car. firmware_id: 16 hexadecimal digits.
  LinkedCar(const Engine& engine, const std::vector<LinkedWorld>& worlds, const LinkedCarOptions& options,
            std::string firmware_id);

  // Gives the car the bytes of a host. They are lost while the cable is unplugged and while the board starts. late: they
  // waited while the simulation stood still.
  void receive(const std::vector<std::uint8_t>& bytes, bool late);
  // Gives the car a fault from now on.
  void inject(const Injection& injection);
  // Advances by one step and returns the bytes that the car has sent. Throws std::runtime_error if the simulation diverges.
  std::vector<std::uint8_t> step();

  // Simulated time (µs).
  std::uint64_t now_us() const { return now_us_; }
  // Whether the cable is plugged in.
  bool plugged_in() const { return now_us_ >= unplugged_until_us_; }

 private:
  void place_at_start();
  void follow_host(const std::vector<std::uint8_t>& bytes);
  void move_to(const std::string& scene_id);
  State state() const;
  void restart(ResetReason reason);
  // Restarts the board and leaves a report, unless the address in the firmware is 0.
  void crash(ResetReason reason, double address);
  void apply_faults();
  void update_outcome();
  void send_truth();
  void send_scene();
  void send_from_simulator(const mavlink_message_t& message);

  const Engine& engine_;
  const std::vector<LinkedWorld>& worlds_;
  const LinkedWorld* world_;
  const LinkedCarOptions options_;
  const std::string firmware_id_;
  std::unique_ptr<SceneTerrain> terrain_;
  SimHal hal_;
  std::unique_ptr<SimCar> car_;
  std::unique_ptr<Firmware> firmware_;
  MotionSensor motion_sensor_;
  LineNoise to_car_noise_{1}, from_car_noise_{2};
  std::uint64_t steps_ = 0;
  std::uint64_t now_us_ = 0;
  std::uint64_t boot_end_us_ = 0;  // time at which the firmware has started or will start
  bool booting_ = false;
  // Times at which injected faults end; 0 for none.
  double servo_battery_v_ = 0;  // until that time
  std::uint64_t servo_battery_until_us_ = 0, battery_until_us_ = 0, bus_until_us_ = 0, imu_until_us_ = 0, button_until_us_ = 0;
  std::uint64_t unplugged_until_us_ = 0;
  State seen_state_ = State::kDisarmed;
  std::optional<Ending> ending_;
  std::optional<ProgramRun> program_;
  double trial_started_s_ = 0;
  std::optional<Outcome> outcome_;
  double outcome_s_ = 0;
  std::uint64_t next_truth_us_ = 0, next_scene_us_ = 0;
  mavlink_status_t simulator_numbering_{};
  mavlink_message_t host_buffer_{};
  mavlink_status_t host_parsing_{};
};

}  // namespace foldcar
