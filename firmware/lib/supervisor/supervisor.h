// The supervisor: decides whether the wheels may be driven. Nothing else enables pulses.
//
// Input: requests (arm, start, …), faults reported by the application, and once a tick time and battery
// voltage. Output: the state, and with it pulses_enabled(). docs/firmware.md holds the whole table of
// transitions and refusals. It has no clock and no hardware.
#pragma once

#include <cstdint>

#include "parameters.h"

namespace foldcar {

enum class State : std::uint8_t { kDisarmed, kArmed, kRunning, kFinished, kFault };

// Latched until acknowledged; the first one stays.
enum class Fault : std::uint8_t {
  kNone,
  kBus,                // the servo driver did not take a write
  kBatteryUnreadable,
  kBatteryLow,         // for longer than BATT_LOW_MS
  kCommandStale,       // the host was silent for longer than CMD_TIMEOUT_MS
  kStoredParameter     // flash holds a parameter outside its limits
};

// Why a request changed nothing; kNone if it was accepted.
enum class Refusal : std::uint8_t {
  kNone,
  kNotArmed,
  kRunning,
  kNotRunning,
  kFaultLatched,
  kNoFault,
  kBatteryUnreadable,
  kBatteryLow,
  kNoWheels,
  kNotANumber,
  kSpeedLimit,
  kYawRateLimit,
  kTimeLimit
};

const char* text(State state);
const char* text(Fault fault);
const char* text(Refusal refusal);

// Largest magnitudes a trial may ask for. They catch wrong units; what the servos can do is WHEEL_MAX_RAD_S.
constexpr float kSpeedLimitMS = 5.0f;
constexpr float kYawRateLimitRadS = 100.0f;

struct TrialRequest {
  float speed_m_s = 0.0f;
  float yaw_rate_rad_s = 0.0f;
  float time_limit_s = 0.0f;
  bool untethered = false;  // drives on without refresh_command, as on the floor without a cable
};

struct SupervisorInputs {
  std::uint64_t now_us = 0;
  float battery_v = 0.0f;
};

class Supervisor {
 public:
  // The parameters must outlive the supervisor; it reads them whenever it decides.
  explicit Supervisor(const Parameters& parameters) : parameters_(parameters) {}

  Refusal arm(float battery_v);
  Refusal disarm();
  Refusal start(const TrialRequest& request, std::uint64_t now_us);
  Refusal stop();
  Refusal acknowledge();
  Refusal refresh_command(std::uint64_t now_us);

  // Something the application has noticed; stops the wheels in every state.
  void report(Fault fault);

  void tick(const SupervisorInputs& inputs);

  bool pulses_enabled() const { return state_ == State::kRunning; }
  State state() const { return state_; }
  Fault fault() const { return fault_; }

  // Of the trial that runs, else of the last one.
  std::uint64_t trial_elapsed_us() const { return trial_elapsed_us_; }

 private:
  Refusal check(const TrialRequest& request) const;
  bool battery_low_for_long(const SupervisorInputs& inputs);

  const Parameters& parameters_;
  State state_ = State::kDisarmed;
  Fault fault_ = Fault::kNone;
  bool untethered_ = false;
  bool battery_low_ = false;
  std::uint64_t battery_low_since_us_ = 0;
  std::uint64_t trial_started_us_ = 0;
  std::uint64_t trial_elapsed_us_ = 0;
  std::uint64_t trial_limit_us_ = 0;
  std::uint64_t refreshed_us_ = 0;
};

}  // namespace foldcar
