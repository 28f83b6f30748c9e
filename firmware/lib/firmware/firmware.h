// The whole firmware of one car on a HAL: parameters, application and link, and the loop that ticks them at 50 Hz.
//
// The board and `carsim link` run this object. Call begin() once, then poll() as often as possible, and store_log() beside it.
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
  // The parts of hal, and build (16 hexadecimal digits), must outlive the firmware.
  Firmware(const Hal& hal, const char* build);

  // Turns the outputs off, sets the parameters, and forgets what has arrived while the board started.
  void begin(const DesignResult& design);
  // Receives and sends bytes, and runs a tick if one is due.
  void poll();
  // To be called again and again beside poll(), from a task of low priority: stores a part of a trial's log in flash, which
  // may take long. Returns whether there is more to do at once.
  bool store_log() { return link_.store_log(); }
  // To be called when the loop has stood still and its clock too, as in a simulation that was stopped: what has arrived
  // meanwhile is refused. poll() sees by itself when the loop was late.
  void stood_still() { link_.receive(true); }
  // To be called when the car stands elsewhere and its IMU has not felt how it came there, as in a simulation that puts it
  // back: the attitude is estimated anew, from the next sample.
  void was_put_elsewhere() { application_.forget_attitude(); }

  const Application& application() const { return application_; }
  const Parameters& parameters() const { return parameters_; }

 private:
  void tick(std::uint64_t now_us);

  Hal hal_;
  Parameters parameters_;
  Application application_;
  LoopStatistics loop_;
  Link link_;
  std::uint64_t deadline_us_ = 0;  // of the next tick
  std::uint64_t polled_us_ = 0;
};

}  // namespace foldcar
