// Reads a scene's program: its endings, verdict and records (docs/carsim.md).
//
// Conditions and values are in postfix order:
// - operands: numbers, booleans, x_m, y_m, rise_m, heading_rad, pitch_rad, roll_rad, speed_m_s, yaw_rate_rad_s, energy_j, time_s;
// - operators: + - * / min max negate abs wrap_rad, < <= > >= and or not;
// - x, y, rise, distance_m: the car's distance from a place; ahead, left, up, x, y, rise, distance_from_m: the distance of a
//   point of the car;
// - x, y, radius, in_disc and [x, y, x, y, …]: whether the car's middle is in a circle or a polygon.
#pragma once

#include "json_reader.h"
#include "program_spec.h"

namespace foldcar {

// Throws InputError, which names the place of a term that is unknown or lacks its operands.
ProgramSpec read_program(JsonReader reader);

}  // namespace foldcar
