// Restarts the board when loop() stands still, sooner while wheels are driven: the servo driver goes on with its last pulses.
//
// The SDK's task watchdog counts whole seconds and does not know which instruction a task has reached. This guard counts
// milliseconds in the tick interrupt of loop()'s core, which sees where it has interrupted loop(). The task watchdog stays
// behind it: it also sees a core whose interrupts come too late.
#pragma once

#include <cstdint>

namespace foldcar {

// Each tick of the firmware writes pulses, or none, and so tells the guard that loop() goes on, and whether wheels turn, before
// it does anything with flash.
class LoopGuard {
 public:
  // Longest time (ms) from one write to the next. While wheels are driven and a log is stored, a tick is at most 40 ms late.
  // While they stand, erasing flash stops both cores for up to 0.4 s.
  static constexpr std::uint32_t kDrivingMs = 250;
  static constexpr std::uint32_t kStandingMs = 800;

  // To be called from loop()'s task, once. The guard begins with the next write. Returns false if the tick interrupt has no
  // room for it.
  static bool begin();
  // loop() is about to write pulses, or none.
  static void feed(bool is_driving);
};

}  // namespace foldcar
