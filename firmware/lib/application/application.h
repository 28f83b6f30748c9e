// The application of one car: owns the tick, read, supervise, control, write.
//
// Input: a HAL and the car's parameters. Rate: tick() about every kTickUs; a late tick does no harm, as the
// time step is taken from the clock. All time comes from the HAL and nothing waits. Many applications fit in
// one process.
#pragma once

#include <cstdint>

#include "calibration.h"
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
  // then loads the stored parameters.
  void begin();

  void tick();

  Refusal arm();
  Refusal disarm();
  // The controller takes its parameters over here; one that changes in the trial acts on the next.
  Refusal start(const TrialRequest& request);
  Refusal stop();
  Refusal acknowledge();
  Refusal refresh_command();

  Status status() const;

 private:
  void write_off();
  void write(const PulsesUs& pulses_us);

  Hal hal_;
  Parameters& parameters_;
  Supervisor supervisor_;
  Calibration calibration_;
  DriveState drive_state_;
  SetPoint set_point_;
  std::uint64_t last_tick_us_ = 0;
  float battery_v_ = 0.0f;
  PulsesUs pulses_us_{};
};

}  // namespace foldcar
