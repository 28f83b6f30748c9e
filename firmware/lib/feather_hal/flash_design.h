// The car's design in the ESP32's flash: the file /car.json of its file system (LittleFS).
#pragma once

#include "car_design.h"

namespace foldcar {

// Reads and checks the file. Needs the file system that FlashLogs::begin() mounts. Takes memory from the heap and gives all
// of it back.
DesignResult read_stored_design();

}  // namespace foldcar
