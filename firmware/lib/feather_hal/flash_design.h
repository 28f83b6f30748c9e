// The car's design in the ESP32's flash: the file /car.json of its file system (LittleFS).
#pragma once

#include "car_design.h"

namespace foldcar {

// Reads and checks the file. mounted: whether FlashLogs::begin() has mounted the file system. Takes memory from the heap and
// gives all of it back.
DesignResult read_stored_design(bool mounted);

}  // namespace foldcar
