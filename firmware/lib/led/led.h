// What the board's LED shows: one pattern for each thing that a person beside the car must know.
#pragma once

#include <cstdint>

#include "log_writer.h"
#include "supervisor.h"

namespace foldcar {

// Whether the LED is on at that time since start (µs). The pattern is that of the first row of the table in led.cpp that
// applies.
bool led_is_on(State state, LogState log, std::uint64_t now_us);

}  // namespace foldcar
