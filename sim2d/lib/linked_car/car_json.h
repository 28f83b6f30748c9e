// car.json for a simulated car, through the firmware's own validation.
#pragma once

#include <string>

#include "car_design.h"

namespace foldcar {

// What the firmware makes of the file's text.
DesignResult read_car_json(const std::string& text);

}  // namespace foldcar
