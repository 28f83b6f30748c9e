#include "linked_car.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "outbox.h"
#include "trial_start.h"

namespace foldcar {
namespace {

constexpr std::uint64_t kTruthPeriodUs = 20000;
constexpr std::uint64_t kScenePeriodUs = 1000000;
constexpr std::uint8_t kSimulatorComponent = MAV_COMP_ID_USER1;
// Time (µs) from a reset to the firmware's start, about that of an ESP32. The servo driver is not reset.
constexpr std::uint64_t kBootUs = 300000;

std::uint8_t code_of(const std::optional<Outcome>& outcome) {
  if (!outcome) return FOLDCAR_OUTCOME_NONE;
  switch (*outcome) {
    case Outcome::kPassed: return FOLDCAR_OUTCOME_PASSED;
    case Outcome::kTipped: return FOLDCAR_OUTCOME_TIPPED;
    case Outcome::kStuck: return FOLDCAR_OUTCOME_STUCK;
    case Outcome::kOffCourse: return FOLDCAR_OUTCOME_OFF_COURSE;
    default: return FOLDCAR_OUTCOME_NONE;  // the car itself reports time-outs and faults
  }
}

}  // namespace

LinkedCar::LinkedCar(const Engine& engine, const std::vector<LinkedWorld>& worlds, const LinkedCarOptions& options,
                     std::string firmware_id)
    : engine_(engine),
      worlds_(worlds),
      world_(&worlds.at(0)),
      options_(options),
      firmware_id_(std::move(firmware_id)),
      terrain_(std::make_unique<SceneTerrain>(world_->scene.terrain)),
      hal_(kLogicBattery_v) {
  hal_.imu.fitted = true;
  hal_.logs.fitted = true;
  for (const auto& [name, value] : options.stored_parameters) hal_.storage.save(name.c_str(), value);
  place_at_start();
  firmware_ = std::make_unique<Firmware>(hal_.hal(), firmware_id_.c_str());
  firmware_->begin(options_.design);
}

// Gives the host's bytes to the firmware, as they arrive over the noisy line. late: they waited while the simulation
// stood still.
void LinkedCar::receive(const std::vector<std::uint8_t>& bytes, bool late) {
  if (!plugged_in() || booting_) return;
  const std::vector<std::uint8_t> arrived = to_car_noise_.pass(bytes, now_us_);
  follow_host(arrived);
  hal_.link.to_car.insert(hal_.link.to_car.end(), arrived.begin(), arrived.end());
  if (late) firmware_->stood_still();
}

// Begins a fault or event, for a time if the injection has one, else for good.
void LinkedCar::inject(const Injection& injection) {
  const std::uint64_t until_us = injection.for_s ? now_us_ + to_us(*injection.for_s) : UINT64_MAX;
  switch (injection.kind) {
    case Injection::Kind::kBattery:
      hal_.battery.volts = static_cast<float>(injection.value);
      battery_until_us_ = until_us;
      break;
    case Injection::Kind::kBatteryUnreadable:
      hal_.battery.volts = std::numeric_limits<float>::quiet_NaN();
      battery_until_us_ = until_us;
      break;
    case Injection::Kind::kServoBattery:
      servo_battery_v_ = injection.value;
      servo_battery_until_us_ = until_us;
      break;
    case Injection::Kind::kBusError: bus_until_us_ = until_us; break;
    case Injection::Kind::kImuError: imu_until_us_ = until_us; break;
    case Injection::Kind::kBrownOut: restart(ResetReason::kBrownOut); break;
    case Injection::Kind::kWatchdog: crash(ResetReason::kTaskWatchdog, injection.value); break;
    case Injection::Kind::kCrash: crash(ResetReason::kCrash, injection.value); break;
    case Injection::Kind::kButton: button_until_us_ = until_us; break;
    case Injection::Kind::kUnplug: unplugged_until_us_ = until_us; break;
    case Injection::Kind::kCorrupt:
    case Injection::Kind::kDrop: {
      const auto noise = injection.kind == Injection::Kind::kDrop ? LineNoise::Kind::kDrop : LineNoise::Kind::kCorrupt;
      to_car_noise_.set(noise, injection.value, until_us);
      from_car_noise_.set(noise, injection.value, until_us);
      break;
    }
    case Injection::Kind::kPutBack: place_at_start(); break;
  }
}

// Advances firmware and car by one step of the engine. Returns the bytes that a host receives from the car.
std::vector<std::uint8_t> LinkedCar::step() {
  apply_faults();
  // The board's clock counts from the firmware's start; nothing reads it before.
  if (now_us_ >= boot_end_us_) hal_.clock.advance_to_us(now_us_ - boot_end_us_);
  if (booting_ && now_us_ >= boot_end_us_) {
    booting_ = false;
    firmware_ = std::make_unique<Firmware>(hal_.hal(), firmware_id_.c_str());
    firmware_->begin(options_.design);
  }
  if (!booting_) {
    // If the car is wired to measure the servo battery, it measures the voltage without a load.
    const bool is_measured = firmware_->parameters().get(Parameter::kServoDivider) > 0.0f;
    const double volts_v = now_us_ < servo_battery_until_us_ ? servo_battery_v_ : world_->body.supply_v;
    hal_.servo_battery.volts = is_measured ? static_cast<float>(volts_v) : std::numeric_limits<float>::quiet_NaN();
    firmware_->poll();
    firmware_->store_log();
  }
  if (hal_.board.restart_is_requested) restart(ResetReason::kSoftware);
  update_outcome();
  send_scene();
  send_truth();

  car_->step(hal_.servos.pulses_us());
  if (!car_->finite()) throw std::runtime_error("the simulation left the finite numbers");
  hal_.imu.now = motion_sensor_.observe(car_->state(), engine_.step_s());
  ++steps_;
  now_us_ = to_us(static_cast<double>(steps_) * engine_.step_s());

  std::vector<std::uint8_t> sent = from_car_noise_.pass(hal_.link.from_car, now_us_);
  hal_.link.from_car.clear();
  if (!plugged_in()) sent.clear();
  return sent;
}

void LinkedCar::place_at_start() {
  car_ = engine_.create_car(world_->body, world_->scene, *terrain_, nullptr);
  motion_sensor_ = MotionSensor();
  hal_.imu.now = motion_sensor_.observe(car_->state(), engine_.step_s());
  // Of a car that has tipped, the estimate would be tilted for a second more, and a trial that starts then be aborted.
  if (firmware_ != nullptr) firmware_->was_put_elsewhere();
}

// Parses the host's packets for FOLDCAR_SCENE, which only the simulator knows, and moves the car to that scene.
void LinkedCar::follow_host(const std::vector<std::uint8_t>& bytes) {
  for (const std::uint8_t byte : bytes) {
    mavlink_message_t message;
    mavlink_status_t status;
    const std::uint8_t result = mavlink_frame_char_buffer(&host_buffer_, &host_parsing_, byte, &message, &status);
    if (result != MAVLINK_FRAMING_OK || message.msgid != MAVLINK_MSG_ID_FOLDCAR_SCENE) continue;
    mavlink_foldcar_scene_t scene;
    mavlink_msg_foldcar_scene_decode(&message, &scene);
    move_to(std::string(scene.id, strnlen(scene.id, sizeof scene.id)));
  }
}

// Moves the car to the start of another scene if it is disarmed and there is such a scene. In any case the scene in
// which it is then is sent at once, as the answer.
void LinkedCar::move_to(const std::string& scene_id) {
  const auto wanted = std::find_if(worlds_.begin(), worlds_.end(),
                                   [&](const LinkedWorld& world) { return world.scene.id == scene_id; });
  if (wanted != worlds_.end() && &*wanted != world_ && state() == State::kDisarmed) {
    world_ = &*wanted;
    terrain_ = std::make_unique<SceneTerrain>(world_->scene.terrain);
    place_at_start();
  }
  next_scene_us_ = now_us_;
}

State LinkedCar::state() const {
  return booting_ ? State::kDisarmed : firmware_->application().status().state;
}

// The servo driver keeps its pulses until the firmware has started again.
void LinkedCar::restart(ResetReason reason) {
  hal_.board.reason = reason;
  hal_.board.crash.reset();
  hal_.board.restart_is_requested = false;
  hal_.link.to_car.clear();
  booting_ = true;
  boot_end_us_ = now_us_ + kBootUs;
}

void LinkedCar::crash(ResetReason reason, double address) {
  restart(reason);
  if (address == 0) return;
  hal_.board.crash.emplace();
  hal_.board.crash->addresses[0] = static_cast<std::uint32_t>(address);
}

// Sets the simulated hardware by the faults that are active now; ends those whose time is over.
void LinkedCar::apply_faults() {
  if (battery_until_us_ != 0 && now_us_ >= battery_until_us_) {
    hal_.battery.volts = static_cast<float>(kLogicBattery_v);
    battery_until_us_ = 0;
  }
  hal_.servos.answers = now_us_ >= bus_until_us_;
  hal_.imu.answers = now_us_ >= imu_until_us_;
  hal_.board.button = now_us_ < button_until_us_;
}

// Follows the firmware's trial: observes it from its start on, and keeps its outcome and time when the simulator or
// the scene's program ends it. If asked for, puts the car back to the start when it is armed.
void LinkedCar::update_outcome() {
  const State state = this->state();
  if (options_.put_back && state == State::kArmed && seen_state_ != State::kArmed) place_at_start();
  const double now_s = 1e-6 * static_cast<double>(now_us_);
  if (state == State::kRunning && seen_state_ != State::kRunning) {
    ending_.emplace(world_->scene, car_->state(), firmware_->application().trial());
    program_.emplace(world_->scene.program, car_->state());
    trial_started_s_ = now_s;
    outcome_.reset();
  }
  seen_state_ = state;
  if (state != State::kRunning || outcome_) return;
  outcome_s_ = now_s - trial_started_s_;
  outcome_ = ending_->check(car_->state(), outcome_s_);
  if (!outcome_) outcome_ = program_->check(car_->state(), outcome_s_);
}

void LinkedCar::send_truth() {
  if (now_us_ < next_truth_us_) return;
  next_truth_us_ += kTruthPeriodUs;
  if (booting_) return;
  const CarState& car = car_->state();
  mavlink_foldcar_truth_t truth{};
  truth.time_usec = hal_.clock.now_us();
  truth.x = static_cast<float>(car.x_m);
  truth.y = static_cast<float>(car.y_m);
  truth.z = static_cast<float>(car.z_m);
  truth.heading = static_cast<float>(car.heading_rad);
  truth.pitch = static_cast<float>(car.pitch_rad);
  truth.roll = static_cast<float>(car.roll_rad);
  truth.speed = static_cast<float>(car.speed_m_s);
  truth.yaw_rate = static_cast<float>(car.yaw_rate_rad_s);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  truth.distance_to_target = static_cast<float>(distance_to_target_m(world_->scene, car).value_or(nan));
  truth.trial_id = firmware_->application().trial().id;
  truth.outcome = code_of(outcome_);
  truth.outcome_time = static_cast<float>(outcome_ ? outcome_s_ : nan);
  mavlink_message_t message;
  mavlink_msg_foldcar_truth_encode_status(kCarSystem, kSimulatorComponent, &simulator_numbering_, &message, &truth);
  send_from_simulator(message);
}

void LinkedCar::send_scene() {
  if (now_us_ < next_scene_us_) return;
  next_scene_us_ += kScenePeriodUs;
  if (booting_) return;
  mavlink_foldcar_scene_t scene{};
  const std::string& id = world_->scene.id;
  std::memcpy(scene.id, id.data(), std::min(id.size(), sizeof scene.id));
  mavlink_message_t message;
  mavlink_msg_foldcar_scene_encode_status(kCarSystem, kSimulatorComponent, &simulator_numbering_, &message, &scene);
  send_from_simulator(message);
}

void LinkedCar::send_from_simulator(const mavlink_message_t& message) {
  std::uint8_t packet[MAVLINK_MAX_PACKET_LEN];
  const std::size_t size = mavlink_msg_to_send_buffer(packet, &message);
  hal_.link.from_car.insert(hal_.link.from_car.end(), packet, packet + size);
}

}  // namespace foldcar
