// The board's HAL, compiled against test/arduino_fakes. PlatformIO leaves out a library of another platform, so its sources
// are included here. Reading car.json needs ArduinoJson, which only PlatformIO's registry has.
#include "../../firmware/lib/feather_hal/feather_board.cpp"
#include "../../firmware/lib/feather_hal/feather_imu.cpp"
#include "../../firmware/lib/feather_hal/feather_servos.cpp"
#include "../../firmware/lib/feather_hal/flash_logs.cpp"
#include "../../firmware/lib/feather_hal/flash_storage.cpp"
#if __has_include(<ArduinoJson.h>)
#include "../../firmware/lib/feather_hal/flash_design.cpp"
#endif
