// The car's design in the ESP32's flash: the file /car.json of its file system (LittleFS).
#pragma once

#include "car_design.h"

namespace foldcar {

// Mounts the file system, reads and checks the file. A file system that does not mount is not formatted, as a design may be in
// it. Takes memory from the heap and gives all of it back.
DesignResult read_stored_design();

}  // namespace foldcar
