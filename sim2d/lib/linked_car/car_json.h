// Reads car.json for a simulated car, with the firmware's own checks.
#pragma once

#include <string>

#include "car_design.h"

namespace foldcar {

// The design that the file's text describes, or why it is refused.
DesignResult read_car_json(const std::string& text);

}  // namespace foldcar
