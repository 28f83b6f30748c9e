// A whole car's firmware on a HAL: parameters, application and link, and the loop that ticks them at 50 Hz.
//
// The board and the simulator that poses as a car run this very object. begin() once, then poll() as often as possible.
#pragma once

#include <cstdint>

#include "application.h"
#include "car_messages.h"
#include "hal.h"
#include "link.h"
#include "parameters.h"

namespace foldcar {

class Firmware {
 public:
  // What hal refers to, and build, must outlive the firmware.
  Firmware(const Hal& hal, const char* build);

  void begin(const DesignResult& design);
  // Moves bytes; ticks if it is time.
  void poll();

  const Application& application() const { return application_; }
  const Parameters& parameters() const { return parameters_; }

 private:
  void tick(std::uint64_t now_us);

  Hal hal_;
  Parameters parameters_;
  Application application_;
  LoopStatistics loop_;
  Link link_;
  std::uint64_t deadline_us_ = 0;
};

}  // namespace foldcar
