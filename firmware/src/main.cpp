// The firmware of the real car: the portable firmware on the Feather's HAL.
#include <Arduino.h>

#include <cstdint>

#include "feather_hal.h"
#include "firmware.h"
#include "firmware_id.h"
#include "flash_design.h"

namespace {

constexpr std::uint32_t kBaud = 115200;

struct Car {
  foldcar::FeatherHal board;
  foldcar::Firmware firmware{board.hal(), FOLDCAR_FIRMWARE_ID};
};

// Made at the first call, in setup(), when the core is up.
Car& car() {
  static Car the_car;
  return the_car;
}

bool store_log(void*) { return car().firmware.store_log(); }

}  // namespace

// begin() turns the outputs off, which may still be driving from before a reset, before it does anything else.
//
// The oscillator's frequency is a parameter, so the servos are ready only behind apply(). If they are not, the first pulse
// is a bus fault.
void setup() {
  Car& me = car();
  me.board.begin(kBaud);
  me.firmware.begin(foldcar::read_stored_design());
  me.board.apply(me.firmware.parameters());
  if (!foldcar::start_background_task(store_log, nullptr)) {
    me.board.logs.give_up();
    me.firmware.store_log();  // sees that there is nothing to wait for: a tethered trial needs no log
  }
  me.board.board.start_watchdog();
}

void loop() {
  car().firmware.poll();
  delay(1);
}
