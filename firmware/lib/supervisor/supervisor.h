// The supervisor: the state machine that decides whether the wheels may be driven. Nothing else enables pulses.
//
// Input: requests (arm, start, …), faults that the application reports, and at each tick the time, the batteries' voltages
// and the tilt. Output: the state, and with it pulses_enabled(). docs/firmware.md has the table of transitions and refusals.
#pragma once

#include <cstdint>
#include <limits>

#include "parameters.h"

namespace foldcar {

// The values of these enums are those of the MAVLink dialect and of docs/link.md.
enum class State : std::uint8_t { kDisarmed, kArmed, kRunning, kFinished, kFault, kManual, kTesting, kCounting };

// A fault stays until it is acknowledged; later ones do not replace it.
enum class Fault : std::uint8_t {
  kNone,
  kBus,                // the servo driver did not acknowledge a write
  kBatteryUnreadable,
  kBatteryLow,         // for longer than BATT_LOW_MS
  kCommandStale,       // the host was silent for longer than CMD_TIMEOUT_MS
  kStoredParameter,    // flash holds a parameter outside its limits
  kDesign,             // car.json is refused
  kWatchdog,           // the task watchdog has reset the board
  kBrownOut,           // a dip of the supply has reset the board
  kTilt,               // beyond TILT_MAX_RAD for longer than TILT_MS
  kImu,                // the IMU that was found at the start no longer answers
  kNoDesign,           // there is no car.json, and nobody has confirmed that the parameters alone describe the car
  kFlash,              // flash memory cannot be read: neither a design nor stored parameters are known
  kInterruptWatchdog,  // the interrupt watchdog has reset the board
  kCrash,              // a crash has reset the board
  kServoBatteryLow     // for longer than BATT_LOW_MS, or switched off
};

// How the last trial ended; kNone before the first and while one runs.
enum class TrialEnd : std::uint8_t { kNone, kTimeLimit, kStopped, kDisarmed, kFault };

// Why a request changed nothing; kNone if it was accepted. kUnknownParameter to kNotSaved: why a parameter was not set or
// saved.
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
  kTimeLimit,
  kDesign,
  kTest,
  kMessage,
  kNotDisarmed,
  kUnknownHost,
  kHeld,
  kLate,
  kNoDesign,
  kUnknownCommand,
  kNoLog,
  kStoring,
  kNoButton,
  kDelay,
  kUnknownParameter,
  kBelowMinimum,
  kAboveMaximum,
  kNotAnInteger,
  kNotASign,
  kFixed,
  kNotSaved,
  kServoBatteryLow
};

const char* text(State state);
const char* text(Fault fault);
const char* text(Refusal refusal);

// Largest magnitudes that a trial may request, against wrong units. The servos' own limit is WHEEL_MAX_RAD_S.
constexpr float kSpeedLimitMS = 5.0f;
constexpr float kYawRateLimitRadS = 100.0f;

// Longest delay (s) between a start and the first pulse.
constexpr float kLongestDelayS = 60.0f;

// Longest test of an output, the limit of MAV_CMD_ACTUATOR_TEST.
constexpr float kLongestTestS = 3.0f;

// A trial: constant speed and yaw rate (positive to the left) for at most time_limit_s, which count from the first pulse.
struct TrialRequest {
  float speed_m_s = 0.0f;
  float yaw_rate_rad_s = 0.0f;
  float time_limit_s = 0.0f;
  bool untethered = false;  // drives without refresh_command, as on the floor without a cable
  std::uint32_t id = 0;     // the host's number of the trial, which telemetry repeats
  float delay_s = 0.0f;     // the car counts so long before its wheels start
  bool waits_for_button = false;  // the car stays armed, without a host, until its button starts the count
};

// Voltages (V) of the board's battery and of the servos'; NaN if unreadable, infinite if the car does not measure it.
struct Batteries {
  // NOLINTNEXTLINE(google-explicit-constructor): most cars measure one battery
  Batteries(float board, float servos = std::numeric_limits<float>::infinity()) : board_v(board), servos_v(servos) {}
  float board_v;
  float servos_v;
};

// What the supervisor needs at each tick.
struct SupervisorInputs {
  std::uint64_t now_us = 0;
  Batteries batteries{0.0f};
  bool imu_lost = false;
  float tilt_rad = 0.0f;  // between the car's up axis and the vertical; 0 without an IMU
};

class Supervisor {
 public:
  // The parameters must outlive the supervisor, which reads them at every decision.
  explicit Supervisor(const Parameters& parameters) : parameters_(parameters) {}

  // From now on arming and tests of outputs are refused for that reason, kDesign or kNoDesign; kNone allows them again.
  void refuse_design(Refusal why) { design_refusal_ = why; }

  // Requests. now_us: time since start (µs).
  Refusal arm(const Batteries& batteries, std::uint64_t now_us);
  Refusal disarm();
  Refusal start(const TrialRequest& request, std::uint64_t now_us);
  // Starts and continues manual driving; moves is false while the stick is at rest, which does not start it.
  Refusal drive_manually(bool moves, std::uint64_t now_us);
  // Enables pulses for the test of an output of a disarmed car, for time_s (0 to kLongestTestS). 0 ends a test.
  Refusal test(float time_s, const Batteries& batteries, std::uint64_t now_us);
  // Ends a trial, its count, manual driving or a test; a trial that waits for the button is forgotten.
  Refusal stop();
  // The car's button: stops whatever drives or counts, and starts the count of a trial that waits for it.
  void press_button(std::uint64_t now_us);
  Refusal acknowledge();
  // Notes that the host that armed or drives is still there.
  Refusal refresh_command(std::uint64_t now_us);

  // Latches a fault, which stops the wheels in every state.
  void report(Fault fault);

  void tick(const SupervisorInputs& inputs);

  bool pulses_enabled() const {
    return state_ == State::kRunning || state_ == State::kManual || state_ == State::kTesting;
  }
  // Whether pulses are on, or will be without a further request.
  bool is_driving() const { return pulses_enabled() || state_ == State::kCounting; }
  State state() const { return state_; }
  Fault fault() const { return fault_; }
  // Whether the car has disarmed because its host was silent, and has not been armed since.
  bool host_timed_out() const { return host_timed_out_; }

  // Elapsed time (µs), request and end of the current trial, else of the last one.
  std::uint64_t trial_elapsed_us() const { return trial_elapsed_us_; }
  // How long (µs) the car still counts; 0 unless it counts.
  std::uint64_t countdown_us() const { return countdown_us_; }
  const TrialRequest& trial() const { return trial_; }
  TrialEnd trial_end() const { return trial_end_; }

 private:
  Refusal check(const TrialRequest& request) const;
  // A condition that counts only if it lasts.
  struct Lasting {
    bool holds = false;
    std::uint64_t since_us = 0;
    // Notes whether it holds now; returns whether it has held for that time (ms).
    bool lasts(bool holds_now, std::uint64_t now_us, float time_ms);
  };

  Refusal check_batteries(const Batteries& batteries) const;
  bool board_battery_is_low(const Batteries& batteries) const;
  bool servo_battery_is_low(const Batteries& batteries) const;
  void start_count(std::uint64_t now_us);
  // Changes the state; end is kept as the end of a trial that runs, counts or waits for the button.
  void set_state(State state, TrialEnd end);

  const Parameters& parameters_;
  State state_ = State::kDisarmed;
  Fault fault_ = Fault::kNone;
  Refusal design_refusal_ = Refusal::kNone;
  bool host_timed_out_ = false;
  TrialRequest trial_;
  TrialEnd trial_end_ = TrialEnd::kNone;
  Lasting battery_low_, servo_battery_low_, tilted_;
  std::uint64_t test_until_us_ = 0;
  bool waits_for_button_ = false;
  std::uint64_t counts_until_us_ = 0;
  std::uint64_t countdown_us_ = 0;
  std::uint64_t trial_started_us_ = 0;
  std::uint64_t trial_elapsed_us_ = 0;
  std::uint64_t trial_limit_us_ = 0;
  std::uint64_t refreshed_us_ = 0;
};

}  // namespace foldcar
