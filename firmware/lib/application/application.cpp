#include "application.h"

#include <algorithm>

namespace foldcar {
namespace {

// After a longer gap the slew limit still holds: the wheels never jump by more than this much of a ramp.
constexpr std::uint64_t kLongestStepUs = 5 * kTickUs;

constexpr PulsesUs kAllOff{};
static_assert(kNoPulse == 0.0f, "kAllOff relies on it");

}  // namespace

Application::Application(const Hal& hal, Parameters& parameters)
    : hal_(hal), parameters_(parameters), supervisor_(parameters) {}

void Application::begin() {
  write_off();
  if (parameters_.load(hal_.storage) > 0) supervisor_.report(Fault::kStoredParameter);
  last_tick_us_ = hal_.clock.now_us();
  battery_v_ = hal_.battery.voltage_v();
}

void Application::tick() {
  const std::uint64_t now_us = hal_.clock.now_us();
  const auto step_us = static_cast<std::uint32_t>(std::min(now_us - last_tick_us_, kLongestStepUs));
  last_tick_us_ = now_us;
  battery_v_ = hal_.battery.voltage_v();
  supervisor_.tick({now_us, battery_v_});
  if (supervisor_.pulses_enabled()) {
    write(drive(calibration_, drive_state_, set_point_, step_us));
  } else {
    write_off();
  }
}

Refusal Application::arm() {
  battery_v_ = hal_.battery.voltage_v();
  return supervisor_.arm(battery_v_);
}

Refusal Application::disarm() {
  const Refusal refusal = supervisor_.disarm();
  write_off();
  return refusal;
}

Refusal Application::start(const TrialRequest& request) {
  const std::uint64_t now_us = hal_.clock.now_us();
  const Refusal refusal = supervisor_.start(request, now_us);
  if (refusal != Refusal::kNone) return refusal;
  calibration_ = calibrate(parameters_);
  drive_state_ = DriveState{};
  set_point_ = {request.speed_m_s, request.yaw_rate_rad_s};
  last_tick_us_ = now_us;
  return refusal;
}

Refusal Application::stop() {
  const Refusal refusal = supervisor_.stop();
  write_off();
  return refusal;
}

Refusal Application::acknowledge() { return supervisor_.acknowledge(); }

Refusal Application::refresh_command() { return supervisor_.refresh_command(hal_.clock.now_us()); }

Status Application::status() const {
  return {supervisor_.state(), supervisor_.fault(), supervisor_.trial_elapsed_us(), battery_v_, pulses_us_};
}

// Every tick anew, as a driver that has not taken it once may take it now.
void Application::write_off() {
  pulses_us_ = kAllOff;
  if (!hal_.servos.write_pulses(kAllOff)) supervisor_.report(Fault::kBus);
}

void Application::write(const PulsesUs& pulses_us) {
  pulses_us_ = pulses_us;
  if (hal_.servos.write_pulses(pulses_us)) return;
  supervisor_.report(Fault::kBus);
  write_off();
}

}  // namespace foldcar
