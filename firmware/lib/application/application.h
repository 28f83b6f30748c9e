// The application of one car. Each tick reads the sensors, supervises, controls and writes the servos.
//
// Input: a HAL, the car's parameters and its design. Rate: tick() about every kTickUs; the time step is measured with the
// HAL's clock, so a late tick changes no result. Nothing waits. Many applications fit in one process.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "attitude.h"
#include "calibration.h"
#include "car_design.h"
#include "differential_drive.h"
#include "hal.h"
#include "parameters.h"
#include "supervisor.h"

namespace foldcar {

constexpr std::uint32_t kTickUs = 20000;  // 50 Hz, the period of the servo pulses

// The car's state at the last tick. pulses_us: as last written; trial_elapsed_us: of the current or else the last trial.
struct Status {
  State state;
  Fault fault;
  std::uint64_t trial_elapsed_us;
  float battery_v;
  PulsesUs pulses_us;
  float servo_battery_v;         // NaN if it is not measured
  std::uint64_t countdown_us;  // how long the car still counts before its wheels start
};

class Application {
 public:
  // The parts of hal and the parameters must outlive the application.
  Application(const Hal& hal, Parameters& parameters);

  // To be called once, before anything else. Turns the outputs off, which may still be driving from before a reset, and
  // then reads the design and the stored parameters.
  void begin(const DesignResult& design = {});

  void tick();

  // Requests. Each returns why it was refused, kNone if it was accepted.
  Refusal arm();
  Refusal disarm();
  // Starts a trial with the controller's parameters as they are now; one that changes during the trial acts on the next.
  Refusal start(const TrialRequest& request);
  // Drives at the fraction forward (-1 to 1) of the largest speed and left (-1 to 1) of the largest yaw rate. Only this
  // call keeps manual driving alive, refresh_command() does not.
  Refusal drive_manually(float forward, float left);
  // Sends one output of a disarmed car (channel from 0) a pulse of pulse_us (1000 to 2000 µs, or kNoPulse) for time_s (s).
  Refusal test(std::size_t channel, float pulse_us, float time_s);
  Refusal stop();
  // confirms: also, that the parameters alone describe a car whose design is missing or unreadable.
  Refusal acknowledge(bool confirms = false);
  // Notes that the host that armed or drives is still there.
  Refusal refresh_command();

  // Sets a parameter, which is to be saved then. Returns kFixed for a parameter that car.json sets.
  SetResult set_parameter(Parameter parameter, float value);
  // The first of the parameters that are to be saved, if there is one.
  std::optional<Parameter> unsaved_parameter() const;
  // Saves it, or gives it up; returns false if it could not be stored. Writing to flash takes up to 0.1 s.
  bool save_parameter(Parameter parameter);
  // Deletes the stored values: those of the design hold again, else the table's defaults. Returns false if that failed.
  bool reset_parameters();

  Status status() const;
  // Whether wheels are driven, or will be without a further request.
  bool is_driving() const { return supervisor_.is_driving(); }
  bool is_armed() const { return supervisor_.state() == State::kArmed || is_driving(); }
  // Whether the car has disarmed because its host was silent, and has not been armed since.
  bool host_timed_out() const { return supervisor_.host_timed_out(); }
  const TrialRequest& trial() const { return supervisor_.trial(); }
  TrialEnd trial_end() const { return supervisor_.trial_end(); }
  const DesignResult& design() const { return design_; }
  const Parameters& parameters() const { return parameters_; }
  const Attitude& attitude() const { return attitude_; }
  // The attitude is unknown until the next sample of the IMU.
  void forget_attitude() { attitude_ = Attitude(); }
  const ImuSample& imu_sample() const { return imu_sample_; }
  // Whether the servo driver acknowledged the last write.
  bool servos_answer() const { return servos_answer_; }

 private:
  // Measures both batteries.
  Batteries measured();
  Fault reset_fault() const;
  Fault design_fault() const;
  void refuse_design();
  // Reports the first fault of the start that nobody has acknowledged.
  void report_start_fault();
  void read_button(std::uint64_t now_us);
  bool read_imu(std::uint32_t step_us);  // false if there is an IMU and it does not answer
  PulsesUs pulses(std::uint32_t step_us);
  void apply_parameters(std::uint64_t now_us);
  void write_off();
  void write(const PulsesUs& pulses_us);

  Hal hal_;
  Parameters& parameters_;
  Supervisor supervisor_;
  DesignResult design_;
  std::array<Fault, 4> start_faults_{};  // what was wrong at the start and is not acknowledged: each is reported in turn
  std::array<bool, kParameterCount> unsaved_{};
  Calibration calibration_;
  DriveState drive_state_;
  SetPoint set_point_;
  PulsesUs test_pulses_us_{};
  Attitude attitude_;
  ImuSample imu_sample_;
  std::uint64_t last_tick_us_ = 0;
  float battery_v_ = 0.0f;
  float servo_battery_v_ = 0.0f;
  std::uint32_t pressed_ticks_ = 0;  // for how long the button is pressed
  bool measures_servo_battery_ = false;
  bool servos_answer_ = false;
  PulsesUs pulses_us_{};
};

}  // namespace foldcar
