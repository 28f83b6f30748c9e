#include "supervisor.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

namespace foldcar {
namespace {

std::uint64_t from_ms(float duration_ms) { return static_cast<std::uint64_t>(1000.0f * duration_ms); }

bool has_wheel_on(const Parameters& parameters, Side side) {
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
    if (parameters.get(channel, ChannelParameter::kSide) == static_cast<float>(side)) return true;
  }
  return false;
}

enum class Request : std::uint8_t { kArm, kDisarm, kStart, kDrive, kTest, kRefresh, kAcknowledge };

// Whether a request is refused because of the state alone, and why. A row for each Request, a column for each State.
constexpr Refusal kRefusals[][8] = {
    // disarmed, armed, running, finished, fault, manual, testing, counting
    /* arm */ {Refusal::kNone, Refusal::kNone, Refusal::kRunning, Refusal::kNone, Refusal::kFaultLatched,
               Refusal::kRunning, Refusal::kRunning, Refusal::kRunning},
    /* disarm */ {Refusal::kNone, Refusal::kNone, Refusal::kNone, Refusal::kNone, Refusal::kFaultLatched,
                  Refusal::kNone, Refusal::kNone, Refusal::kNone},
    /* start */ {Refusal::kNotArmed, Refusal::kNone, Refusal::kRunning, Refusal::kNotArmed, Refusal::kFaultLatched,
                 Refusal::kRunning, Refusal::kRunning, Refusal::kRunning},
    /* drive */ {Refusal::kNotArmed, Refusal::kNone, Refusal::kRunning, Refusal::kNotArmed, Refusal::kFaultLatched,
                 Refusal::kNone, Refusal::kRunning, Refusal::kRunning},
    /* test */ {Refusal::kNone, Refusal::kNotDisarmed, Refusal::kRunning, Refusal::kNone, Refusal::kFaultLatched,
                Refusal::kRunning, Refusal::kNone, Refusal::kRunning},
    // The stick alone keeps manual driving alive.
    /* refresh */ {Refusal::kNotRunning, Refusal::kNone, Refusal::kNone, Refusal::kNotRunning, Refusal::kFaultLatched,
                   Refusal::kNotRunning, Refusal::kNone, Refusal::kNone},
    /* acknowledge */ {Refusal::kNoFault, Refusal::kNoFault, Refusal::kNoFault, Refusal::kNoFault, Refusal::kNone,
                       Refusal::kNoFault, Refusal::kNoFault, Refusal::kNoFault},
};

Refusal refusal_in(State state, Request request) {
  return kRefusals[static_cast<std::size_t>(request)][static_cast<std::size_t>(state)];
}

}  // namespace

Refusal Supervisor::arm(const Batteries& batteries, std::uint64_t now_us) {
  Refusal refusal = refusal_in(state_, Request::kArm);
  if (refusal == Refusal::kNone) refusal = design_refusal_;
  if (refusal == Refusal::kNone) refusal = check_batteries(batteries);
  if (refusal != Refusal::kNone) return refusal;
  refreshed_us_ = now_us;
  host_timed_out_ = false;
  set_state(State::kArmed, TrialEnd::kStopped);
  return refusal;
}

Refusal Supervisor::disarm() {
  const Refusal refusal = refusal_in(state_, Request::kDisarm);
  if (refusal == Refusal::kNone) set_state(State::kDisarmed, TrialEnd::kDisarmed);
  return refusal;
}

// Accepts a trial. It runs at once, after its delay, or after the button is pressed.
Refusal Supervisor::start(const TrialRequest& request, std::uint64_t now_us) {
  Refusal refusal = refusal_in(state_, Request::kStart);
  if (refusal == Refusal::kNone) refusal = check(request);
  if (refusal != Refusal::kNone) return refusal;
  trial_ = request;
  trial_end_ = TrialEnd::kNone;
  trial_elapsed_us_ = 0;
  trial_limit_us_ = static_cast<std::uint64_t>(1e6 * static_cast<double>(request.time_limit_s));
  refreshed_us_ = now_us;
  waits_for_button_ = request.waits_for_button;
  if (!waits_for_button_) start_count(now_us);
  return Refusal::kNone;
}

void Supervisor::start_count(std::uint64_t now_us) {
  waits_for_button_ = false;
  countdown_us_ = from_ms(1000.0f * trial_.delay_s);
  counts_until_us_ = trial_started_us_ = now_us + countdown_us_;
  state_ = countdown_us_ > 0 ? State::kCounting : State::kRunning;
}

void Supervisor::press_button(std::uint64_t now_us) {
  if (is_driving()) {
    stop();
  } else if (state_ == State::kArmed && waits_for_button_) {
    start_count(now_us);
  }
}

// Begins or continues manual driving. moves: the stick is out of its middle; an armed car waits for that.
Refusal Supervisor::drive_manually(bool moves, std::uint64_t now_us) {
  const Refusal refusal = refusal_in(state_, Request::kDrive);
  if (refusal != Refusal::kNone) return refusal;
  if (state_ == State::kArmed && !moves) return Refusal::kNone;
  refreshed_us_ = now_us;
  set_state(State::kManual, TrialEnd::kStopped);
  return Refusal::kNone;
}

Refusal Supervisor::test(float time_s, const Batteries& batteries, std::uint64_t now_us) {
  Refusal refusal = refusal_in(state_, Request::kTest);
  if (refusal == Refusal::kNone) refusal = design_refusal_;
  if (refusal == Refusal::kNone && !(time_s >= 0.0f && time_s <= kLongestTestS)) refusal = Refusal::kTest;
  if (refusal == Refusal::kNone) refusal = check_batteries(batteries);
  if (refusal != Refusal::kNone) return refusal;
  refreshed_us_ = now_us;
  test_until_us_ = now_us + from_ms(1000.0f * time_s);
  state_ = time_s > 0.0f ? State::kTesting : State::kDisarmed;
  return Refusal::kNone;
}

// Ends what drives the wheels, or the wait for the button. Always succeeds.
Refusal Supervisor::stop() {
  if (state_ == State::kRunning || state_ == State::kCounting) {
    set_state(State::kFinished, TrialEnd::kStopped);
  } else if (pulses_enabled()) {
    state_ = State::kDisarmed;
  } else if (waits_for_button_) {
    set_state(State::kArmed, TrialEnd::kStopped);
  }
  return Refusal::kNone;
}

Refusal Supervisor::acknowledge() {
  const Refusal refusal = refusal_in(state_, Request::kAcknowledge);
  if (refusal != Refusal::kNone) return refusal;
  fault_ = Fault::kNone;
  state_ = State::kDisarmed;
  return refusal;
}

Refusal Supervisor::refresh_command(std::uint64_t now_us) {
  const Refusal refusal = refusal_in(state_, Request::kRefresh);
  if (refusal == Refusal::kNone) refreshed_us_ = now_us;
  return refusal;
}

void Supervisor::report(Fault fault) {
  if (state_ == State::kFault) return;
  fault_ = fault;
  set_state(State::kFault, TrialEnd::kFault);
}

// Checks, while the car is armed or drives, everything that must end that: battery, IMU, tilt, time limits and a
// silent host. Counts down and lets a trial begin.
void Supervisor::tick(const SupervisorInputs& inputs) {
  // Servos that start reduce the voltage for a moment, and a bump disturbs the estimate of the tilt: only what stays means
  // an empty battery, or a car on its side.
  const float low_ms = parameters_.get(Parameter::kBattLowMs);
  const bool battery_low = battery_low_.lasts(board_battery_is_low(inputs.batteries), inputs.now_us, low_ms);
  const bool servo_battery_low = servo_battery_low_.lasts(servo_battery_is_low(inputs.batteries), inputs.now_us, low_ms);
  const bool is_tilted = inputs.tilt_rad > parameters_.get(Parameter::kTiltMaxRad);
  const bool tilted = tilted_.lasts(is_tilted, inputs.now_us, parameters_.get(Parameter::kTiltMs));
  if (state_ != State::kArmed && !is_driving()) return;
  if (std::isnan(inputs.batteries.board_v)) return report(Fault::kBatteryUnreadable);
  if (battery_low) return report(Fault::kBatteryLow);
  if (servo_battery_low) return report(Fault::kServoBatteryLow);
  if (inputs.imu_lost) return report(Fault::kImu);
  const std::uint64_t silent_us = inputs.now_us - refreshed_us_;
  if (state_ == State::kArmed) {
    // A car that waits for its button needs no host, but does not wait for ever.
    const Parameter limit_s = waits_for_button_ ? Parameter::kTrialMaxS : Parameter::kArmTimeoutS;
    host_timed_out_ = silent_us > from_ms(1000.0f * parameters_.get(limit_s));
    if (host_timed_out_) set_state(State::kDisarmed, TrialEnd::kDisarmed);
    return;
  }
  if (state_ == State::kCounting) {
    countdown_us_ = counts_until_us_ - std::min(counts_until_us_, inputs.now_us);
    if (countdown_us_ == 0) state_ = State::kRunning;
  }
  // A car that counts may still be in someone's hands.
  if (tilted && (state_ == State::kRunning || state_ == State::kManual)) return report(Fault::kTilt);

  if (state_ == State::kRunning) {
    trial_elapsed_us_ = inputs.now_us - trial_started_us_;
    if (trial_elapsed_us_ >= trial_limit_us_) return set_state(State::kFinished, TrialEnd::kTimeLimit);
  }
  if ((state_ == State::kRunning || state_ == State::kCounting) && trial_.untethered) return;
  if (state_ == State::kTesting && inputs.now_us >= test_until_us_) {
    state_ = State::kDisarmed;
    return;
  }
  const std::uint64_t longest_us = from_ms(parameters_.get(Parameter::kCmdTimeoutMs));
  if (silent_us > longest_us) report(Fault::kCommandStale);
}

// Checks a trial's numbers against their limits, and that there is a wheel on both sides.
Refusal Supervisor::check(const TrialRequest& request) const {
  for (const float value : {request.speed_m_s, request.yaw_rate_rad_s, request.time_limit_s, request.delay_s}) {
    if (std::isnan(value)) return Refusal::kNotANumber;
  }
  if (std::fabs(request.speed_m_s) > kSpeedLimitMS) return Refusal::kSpeedLimit;
  if (std::fabs(request.yaw_rate_rad_s) > kYawRateLimitRadS) return Refusal::kYawRateLimit;
  if (request.time_limit_s <= 0.0f || request.time_limit_s > parameters_.get(Parameter::kTrialMaxS)) {
    return Refusal::kTimeLimit;
  }
  if (request.delay_s < 0.0f || request.delay_s > kLongestDelayS) return Refusal::kDelay;
  const bool drivable = has_wheel_on(parameters_, Side::kLeft) && has_wheel_on(parameters_, Side::kRight);
  return drivable ? Refusal::kNone : Refusal::kNoWheels;
}

Refusal Supervisor::check_batteries(const Batteries& batteries) const {
  if (std::isnan(batteries.board_v)) return Refusal::kBatteryUnreadable;
  if (board_battery_is_low(batteries)) return Refusal::kBatteryLow;
  return servo_battery_is_low(batteries) ? Refusal::kServoBatteryLow : Refusal::kNone;
}

bool Supervisor::board_battery_is_low(const Batteries& batteries) const {
  return batteries.board_v < parameters_.get(Parameter::kBattMinV);
}

// A battery that cannot be read is switched off, or its divider broken: nothing would see when it is empty.
bool Supervisor::servo_battery_is_low(const Batteries& batteries) const {
  const float lowest_v = parameters_.get(Parameter::kServoMinV);
  return lowest_v > 0.0f && !(batteries.servos_v >= lowest_v);
}

bool Supervisor::Lasting::lasts(bool holds_now, std::uint64_t now_us, float time_ms) {
  if (holds_now && !holds) since_us = now_us;
  holds = holds_now;
  return holds && now_us - since_us >= from_ms(time_ms);
}

// Changes the state. `end` is how a trial that runs, counts down or waits for the button ends by that.
void Supervisor::set_state(State state, TrialEnd end) {
  if (state_ == State::kRunning || state_ == State::kCounting || waits_for_button_) trial_end_ = end;
  waits_for_button_ = false;
  countdown_us_ = 0;
  state_ = state;
}

}  // namespace foldcar
