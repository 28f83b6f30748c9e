// Keeps where the program was over the reset by which a crash or a watchdog ends it.
//
// The report is in RTC memory, which every reset but that of the power leaves as it is. It is written by the SDK's panic
// handler, and by the guard of loop() (loop_guard.h), which knows where loop() stands.
#pragma once

#include <cstdint>

#include "hal.h"

namespace foldcar {

// A place in a task's stack: the program counter, the stack pointer and the return address there.
struct StackPlace {
  std::uint32_t pc, sp, return_address;
};

// Fills the addresses of a report: of the place, of its caller, and so on. May be called in an interrupt, and with flash off.
void trace_callers(const StackPlace& place, CrashReport& report);

// Keeps the report over the next reset, unless one has been kept since the start: what follows a crash is not its cause.
// May be called in an interrupt, and with flash off.
void keep_crash(const CrashReport& report);

// Takes the report that was kept before the last reset. Returns false if there is none.
bool take_crash(CrashReport& report);

}  // namespace foldcar
