// The limits of the protocol's numbers, in one table: input is checked with it, and `carsim limits` prints it.
#pragma once

#include <map>
#include <string>

namespace foldcar {

struct Limits {
  double minimum;
  double maximum;
};

// By the number's path in its line without the places in lists: "body.wheels.servo.neutral_us". A piece of terrain has
// its kind in the path: "scene.terrain.box.height_m". "body.wheels.count" is how many entries that list has.
// Bounds that depend on other numbers of the line come on top, in the readers.
const std::map<std::string, Limits>& input_limits();

// The row of that path. std::logic_error if there is none.
Limits limits_of(const std::string& path);

}  // namespace foldcar
