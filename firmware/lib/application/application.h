// The application of one car: owns the tick, read, supervise, control, write.
//
// Input: a HAL, the car's parameters and its design. Rate: tick() about every kTickUs; a late tick does no harm, as
// the time step is taken from the clock. All time comes from the HAL and nothing waits. Many applications fit in
// one process.
#pragma once

#include <cstddef>
#include <cstdint>

#include "attitude.h"
#include "calibration.h"
#include "car_design.h"
#include "differential_drive.h"
#include "hal.h"
#include "parameters.h"
#include "supervisor.h"

namespace foldcar {

constexpr std::uint32_t kTickUs = 20000;  // 50 Hz, the period of the servo pulses

struct Status {
  State state;
  Fault fault;
  std::uint64_t trial_elapsed_us;
  float battery_v;
  PulsesUs pulses_us;  // as last written
};

class Application {
 public:
  // What hal refers to and the parameters must outlive the application.
  Application(const Hal& hal, Parameters& parameters);

  // Call once, first of all: turns the outputs off, which may still be driving from before a reset, and only
  // then takes over the design and the stored parameters.
  void begin(const DesignResult& design = {});

  void tick();

  Refusal arm();
  Refusal disarm();
  // The controller takes its parameters over here; one that changes in the trial acts on the next.
  Refusal start(const TrialRequest& request);
  // Each of forward and left from -1 to 1, of the fastest that the wheels can.
  Refusal drive_by_hand(float forward, float left);
  // A pulse, or none, on one output of a disarmed car; its channel counts from 0.
  Refusal test(std::size_t channel, float pulse_us, float time_s);
  Refusal stop();
  Refusal acknowledge();
  Refusal refresh_command();

  // Sets and saves. Refused with kFixed what car.json sets; saved is false if storage did not take it.
  SetResult set_parameter(Parameter parameter, float value, bool& saved);
  // Forgets what is stored: the design's values hold again, else the table's. False if storage did not.
  bool forget_parameters();

  Status status() const;
  bool is_driving() const { return supervisor_.pulses_enabled(); }
  const TrialRequest& trial() const { return supervisor_.trial(); }
  TrialEnd trial_end() const { return supervisor_.trial_end(); }
  const DesignResult& design() const { return design_; }
  const Parameters& parameters() const { return parameters_; }
  const Attitude& attitude() const { return attitude_; }
  const ImuSample& imu_sample() const { return imu_sample_; }
  // Whether the servo driver took the last write.
  bool servos_answer() const { return servos_answer_; }

 private:
  void report_reset();
  bool read_imu(std::uint32_t step_us);  // false if it was there and does not answer
  PulsesUs pulses(std::uint32_t step_us);
  void take_over_parameters(std::uint64_t now_us);
  void write_off();
  void write(const PulsesUs& pulses_us);

  Hal hal_;
  Parameters& parameters_;
  Supervisor supervisor_;
  DesignResult design_;
  Calibration calibration_;
  DriveState drive_state_;
  SetPoint set_point_;
  PulsesUs test_pulses_us_{};
  Attitude attitude_;
  ImuSample imu_sample_;
  std::uint64_t last_tick_us_ = 0;
  float battery_v_ = 0.0f;
  bool servos_answer_ = false;
  PulsesUs pulses_us_{};
};

}  // namespace foldcar
