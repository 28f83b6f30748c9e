// Restarts the board when loop() stands still, sooner while wheels are driven: the servo driver goes on with its last pulses.
//
// The SDK's task watchdog counts whole seconds and does not know which instruction a task has reached. This guard counts
// milliseconds in the tick interrupt of loop()'s core, which sees where it has interrupted loop(). The task watchdog stays
// behind it: it also sees a core whose interrupts come too late.
#pragma once

#include <cstdint>

namespace foldcar {

class LoopGuard {
 public:
  // Longest time (ms) between two rounds of loop(). A tick is at most 40 ms late while wheels are driven and a log is stored.
  // While they stand, erasing flash stops both cores for up to 0.4 s.
  static constexpr std::uint32_t kDrivingMs = 250;
  static constexpr std::uint32_t kStandingMs = 800;

  // To be called from loop()'s task, once. Returns false if the tick interrupt has no room for the guard.
  bool begin();
  // A round of loop() has ended; wheels are driven from here on, or not.
  void feed(bool is_driving);
};

}  // namespace foldcar
