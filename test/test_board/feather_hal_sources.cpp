// The board's HAL, compiled against test/arduino_fakes. PlatformIO leaves out a library of another platform, so its sources
// are included here. Reading car.json needs ArduinoJson, which only PlatformIO's registry has.
#include "../../firmware/lib/feather_hal/background_task.cpp"
#include "../../firmware/lib/feather_hal/crash_memory.cpp"
#include "../../firmware/lib/feather_hal/feather_board.cpp"
#include "../../firmware/lib/feather_hal/feather_imu.cpp"
#include "../../firmware/lib/feather_hal/feather_servos.cpp"
#include "../../firmware/lib/feather_hal/flash_logs.cpp"
#include "../../firmware/lib/feather_hal/flash_storage.cpp"
#include "../../firmware/lib/feather_hal/loop_guard.cpp"
#include "../../firmware/lib/feather_hal/output_gate.cpp"
#if __has_include(<ArduinoJson.h>)
#include "../../firmware/lib/feather_hal/flash_design.cpp"
#else
#include "../../firmware/lib/feather_hal/flash_design.h"
// A board without the reader has no design either.
foldcar::DesignResult foldcar::read_stored_design() {
  DesignResult absent;
  absent.source = fake_esp32.flash.is_formatted ? DesignSource::kMissing : DesignSource::kUnreadable;
  return absent;
}
#endif
