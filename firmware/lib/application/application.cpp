#include "application.h"

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

// Longest time step of the controller: after a longer gap a pulse changes by what the slew limit allows in this time.
constexpr std::uint64_t kLongestStepUs = 5 * kTickUs;

constexpr PulsesUs kAllOff{};
static_assert(kNoPulse == 0.0f, "kAllOff is made of zeros");

}  // namespace

Application::Application(const Hal& hal, Parameters& parameters)
    : hal_(hal), parameters_(parameters), supervisor_(parameters) {}

// Starts with the outputs off and the parameters of design and storage. Whatever should keep the car from driving is
// kept as a start fault; each must be acknowledged.
void Application::begin(const DesignResult& design) {
  write_off();
  design_ = design;
  const bool stored_is_refused = configure(parameters_, design_, hal_.storage) > 0;
  start_faults_ = {reset_fault(), design_fault(), hal_.storage.present() ? Fault::kNone : Fault::kFlash,
                   stored_is_refused ? Fault::kStoredParameter : Fault::kNone};
  refuse_design();
  report_start_fault();
  last_tick_us_ = hal_.clock.now_us();
  // The board reads its divider at the start only.
  measures_servo_battery_ = parameters_.get(Parameter::kServoDivider) > 0.0f;
  measured();
}

// One control step: measures batteries, button and IMU, lets the supervisor decide, then writes pulses or none.
void Application::tick() {
  const std::uint64_t now_us = hal_.clock.now_us();
  const auto step_us = static_cast<std::uint32_t>(std::min(now_us - last_tick_us_, kLongestStepUs));
  last_tick_us_ = now_us;
  const Batteries batteries = measured();
  read_button(now_us);
  const bool imu_lost = !read_imu(step_us);
  supervisor_.tick({now_us, batteries, imu_lost, attitude_.known ? tilt_rad(attitude_) : 0.0f});
  if (supervisor_.pulses_enabled()) {
    write(pulses(step_us));
  } else {
    write_off();
  }
}

Refusal Application::arm() { return supervisor_.arm(measured(), hal_.clock.now_us()); }

Refusal Application::disarm() {
  const Refusal refusal = supervisor_.disarm();
  write_off();
  return refusal;
}

Refusal Application::start(const TrialRequest& request) {
  if (request.waits_for_button && parameters_.get(Parameter::kButtonWired) == 0.0f) return Refusal::kNoButton;
  const std::uint64_t now_us = hal_.clock.now_us();
  const Refusal refusal = supervisor_.start(request, now_us);
  if (refusal != Refusal::kNone) return refusal;
  apply_parameters(now_us);
  set_point_ = {request.speed_m_s, request.yaw_rate_rad_s};
  return refusal;
}

// Takes the stick's position, -1 to 1 forward and left, as fractions of the fastest wheel speed.
Refusal Application::drive_manually(float forward, float left) {
  if (!(std::fabs(forward) <= 1.0f && std::fabs(left) <= 1.0f)) return Refusal::kNotANumber;
  const std::uint64_t now_us = hal_.clock.now_us();
  const bool was_manual = supervisor_.state() == State::kManual;
  const Refusal refusal = supervisor_.drive_manually(forward != 0.0f || left != 0.0f, now_us);
  if (refusal != Refusal::kNone || supervisor_.state() != State::kManual) return refusal;
  if (!was_manual) apply_parameters(now_us);
  const float fastest_m_s = calibration_.wheel_max_rad_s * calibration_.wheel_radius_m;
  set_point_ = {forward * fastest_m_s, left * fastest_m_s / calibration_.half_track_m};
  return refusal;
}

Refusal Application::test(std::size_t channel, float pulse_us, float time_s) {
  const bool fits = pulse_us == kNoPulse || (pulse_us >= kShortestPulseUs && pulse_us <= kLongestPulseUs);
  if (channel >= kChannelCount || !fits) return Refusal::kTest;
  const Refusal refusal = supervisor_.test(time_s, measured(), hal_.clock.now_us());
  if (refusal != Refusal::kNone) return refusal;
  test_pulses_us_ = kAllOff;
  test_pulses_us_[channel] = pulse_us;
  if (!supervisor_.pulses_enabled()) write_off();
  return refusal;
}

Refusal Application::stop() {
  const Refusal refusal = supervisor_.stop();
  write_off();
  return refusal;
}

// Acknowledges the present fault, then reports the next start fault, if any. confirms: a person confirms that the
// parameters describe the car, so that it may drive without a design.
Refusal Application::acknowledge(bool confirms) {
  const Fault fault = supervisor_.fault();
  const bool absent = is_absent(design_.source);
  if (absent && (fault == Fault::kNoDesign || fault == Fault::kFlash) && !confirms) return Refusal::kNoDesign;
  const Refusal refusal = supervisor_.acknowledge();
  if (refusal != Refusal::kNone) return refusal;
  if (absent && confirms) {
    std::replace(start_faults_.begin(), start_faults_.end(), design_fault(), Fault::kNone);
    design_.source = DesignSource::kNone;
    refuse_design();
  }
  std::replace(start_faults_.begin(), start_faults_.end(), fault, Fault::kNone);
  report_start_fault();
  return refusal;
}

Refusal Application::refresh_command() { return supervisor_.refresh_command(hal_.clock.now_us()); }

SetResult Application::set_parameter(Parameter parameter, float value) {
  const SetResult result = parameters_.set(parameter, value);
  if (result == SetResult::kOk) unsaved_[static_cast<std::size_t>(parameter)] = true;
  return result;
}

std::optional<Parameter> Application::unsaved_parameter() const {
  const auto found = std::find(unsaved_.begin(), unsaved_.end(), true);
  if (found == unsaved_.end()) return std::nullopt;
  return static_cast<Parameter>(found - unsaved_.begin());
}

bool Application::save_parameter(Parameter parameter) {
  unsaved_[static_cast<std::size_t>(parameter)] = false;
  return parameters_.save(hal_.storage, parameter);
}

bool Application::reset_parameters() {
  if (!hal_.storage.clear()) return false;
  unsaved_.fill(false);
  parameters_ = Parameters();
  configure(parameters_, design_, hal_.storage);
  return true;
}

Status Application::status() const {
  return {supervisor_.state(), supervisor_.fault(), supervisor_.trial_elapsed_us(), battery_v_,
          pulses_us_,          servo_battery_v_,    supervisor_.countdown_us()};
}

Batteries Application::measured() {
  battery_v_ = hal_.battery.voltage_v();
  servo_battery_v_ = hal_.servo_battery.voltage_v();
  return measures_servo_battery_ ? Batteries(battery_v_, servo_battery_v_) : Batteries(battery_v_);
}

// Returns the fault that the last reset means. Brown-outs and watchdogs may be due to the servos' current, so a person
// must acknowledge them before the car drives again.
Fault Application::reset_fault() const {
  switch (hal_.board.reset_reason()) {
    case ResetReason::kBrownOut: return Fault::kBrownOut;
    case ResetReason::kCrash: return Fault::kCrash;
    case ResetReason::kInterruptWatchdog: return Fault::kInterruptWatchdog;
    // The chip's own watchdogs guard start and restart.
    case ResetReason::kTaskWatchdog:
    case ResetReason::kOtherWatchdog: return Fault::kWatchdog;
    case ResetReason::kUnknown:
    case ResetReason::kPowerOn:
    case ResetReason::kExternalPin:
    case ResetReason::kSoftware:
    case ResetReason::kDeepSleep: return Fault::kNone;
  }
  return Fault::kNone;
}

// Returns the fault of a design that was not loaded: with default parameters a car would drive the wrong outputs at
// the wrong speed.
Fault Application::design_fault() const {
  switch (design_.source) {
    case DesignSource::kNone:
    case DesignSource::kFile: return Fault::kNone;
    case DesignSource::kRefused: return Fault::kDesign;
    case DesignSource::kMissing: return Fault::kNoDesign;
    case DesignSource::kUnreadable: return Fault::kFlash;
  }
  return Fault::kNone;
}

void Application::refuse_design() {
  const bool refused = design_.source == DesignSource::kRefused;
  supervisor_.refuse_design(refused                      ? Refusal::kDesign
                            : is_absent(design_.source) ? Refusal::kNoDesign
                                                        : Refusal::kNone);
}

void Application::report_start_fault() {
  const auto found = std::find_if(start_faults_.begin(), start_faults_.end(), [](Fault f) { return f != Fault::kNone; });
  if (found != start_faults_.end()) supervisor_.report(*found);
}

// Passes the button on, once for each time it is pressed, at the second tick that sees it so: a contact that bounces
// for less than a tick is seen pressed at one tick only.
void Application::read_button(std::uint64_t now_us) {
  constexpr std::uint32_t kPressedTicks = 2;
  const bool is_pressed = parameters_.get(Parameter::kButtonWired) == 1.0f && hal_.board.button_is_pressed();
  pressed_ticks_ = is_pressed ? pressed_ticks_ + 1 : 0;
  if (pressed_ticks_ == kPressedTicks) supervisor_.press_button(now_us);
}

// Reads the IMU, if fitted, and updates the attitude. Returns false if it does not answer.
bool Application::read_imu(std::uint32_t step_us) {
  if (!hal_.imu.present()) return true;
  if (!hal_.imu.read(imu_sample_)) return false;
  attitude_ = updated(attitude_, imu_sample_, 1e-6f * static_cast<float>(step_us));
  return true;
}

PulsesUs Application::pulses(std::uint32_t step_us) {
  if (supervisor_.state() == State::kTesting) return test_pulses_us_;
  return drive(calibration_, drive_state_, set_point_, step_us);
}

void Application::apply_parameters(std::uint64_t now_us) {
  calibration_ = calibrate(parameters_);
  drive_state_ = DriveState{};
  last_tick_us_ = now_us;
}

// Turns all outputs off. Called at every tick, because a driver that did not acknowledge may do so at the next.
void Application::write_off() {
  pulses_us_ = kAllOff;
  servos_answer_ = hal_.servos.write_pulses(kAllOff);
  if (!servos_answer_) supervisor_.report(Fault::kBus);
}

void Application::write(const PulsesUs& pulses_us) {
  pulses_us_ = pulses_us;
  servos_answer_ = hal_.servos.write_pulses(pulses_us);
  if (servos_answer_) return;
  supervisor_.report(Fault::kBus);
  write_off();
}

}  // namespace foldcar
