// The firmware of the real car: puts the portable firmware on the Feather's HAL.
#include <Arduino.h>

#include <cstdint>

#include "feather_hal.h"
#include "firmware.h"
#include "firmware_id.h"

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

}  // namespace

// What the board's parts answer is not looked at here: a servo driver that is not ready fails the application's
// first write, or its first pulse, and the supervisor latches that; without flash the defaults hold.
void setup() {
  Car& me = car();
  me.board.servos.begin();
  me.board.link.begin(kBaud);
  me.board.imu.begin();
  me.board.storage.begin();
  me.board.logs.begin();
  me.firmware.begin(foldcar::read_car_json());
  me.board.servos.set_oscillator_hz(me.firmware.parameters().get(foldcar::Parameter::kPwmOscHz));
  me.board.board.start_watchdog();
}

void loop() {
  car().firmware.poll();
  delay(1);
}
