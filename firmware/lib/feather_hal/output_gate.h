// The servo driver's output enable (#OE), for boards on which it is wired to GPIO27 with a pull-up (docs/firmware.md).
//
// Low lets pulses through. Pulses end with a reset of the chip, whose pin floats then and is pulled up; with a crash and
// a dip of the supply, whose handlers set the pin high; and, by a timer of the other core than loop()'s, with a loop that
// no longer writes pulses.
#pragma once

#include <esp_timer.h>

#include <cstdint>

namespace foldcar {

class OutputGate {
 public:
  // How long (µs) pulses last without another open(); a tick that waits for flash is at most half as late.
  static constexpr std::uint64_t kHoldUs = 150000;
  static constexpr std::uint8_t kPin = 27;

  // From now on the gate is used, and closed; until then open() and close() leave the pin alone. Returns false if there is
  // no timer: the gate stays closed then.
  bool begin();
  // Lets pulses through for kHoldUs. Returns false if it cannot; none are let through then.
  bool open();
  void close();
  // Sets the pin high. Without a wire it is no output, and its level has no effect. May be called in an interrupt, and with
  // flash off.
  static void disable_output();

 private:
  bool is_used_ = false;
  esp_timer_handle_t timer_ = nullptr;
};

}  // namespace foldcar
