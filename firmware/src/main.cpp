// The firmware of the real car: wires the portable application to the Feather's HAL and ticks it at 50 Hz.
#include <Arduino.h>
#include <esp_system.h>

#include <cinttypes>
#include <cstdio>

#include "application.h"
#include "console.h"
#include "feather_hal.h"

namespace {

constexpr std::uint32_t kBaud = 115200;

struct Car {
  foldcar::FeatherHal board;
  foldcar::Parameters parameters;
  foldcar::Application application{board.hal(), parameters};
  foldcar::Console console{application, board.link};
  std::uint64_t deadline_us = 0;
};

// Made at the first call, in setup(), when the core is up.
Car& car() {
  static Car the_car;
  return the_car;
}

// A brown-out at the start of the servos is the usual failure and shows only here.
void report_reset_reason(foldcar::ByteLink& link) {
  char line[40];
  const int size = std::snprintf(line, sizeof line, "\r\nfoldcar, reset reason %d\r\n",
                                 static_cast<int>(esp_reset_reason()));
  if (size > 0) link.write(reinterpret_cast<const std::uint8_t*>(line), static_cast<std::size_t>(size));
}

}  // namespace

// What the board's parts answer is not looked at here: a servo driver that is not ready fails the application's
// first write, or its first pulse, and the supervisor latches that; without flash the defaults hold.
void setup() {
  Car& me = car();
  me.board.servos.begin();
  me.board.link.begin(kBaud);
  report_reset_reason(me.board.link);
  me.board.storage.begin();
  me.application.begin();
  me.board.servos.set_oscillator_hz(me.parameters.get(foldcar::Parameter::kPwmOscHz));
  me.deadline_us = me.board.clock.now_us();
}

void loop() {
  Car& me = car();
  const std::uint64_t now_us = me.board.clock.now_us();
  if (now_us < me.deadline_us) {
    delay(1);
    return;
  }
  // The next deadline counts from this one, so ticks do not drift; ticks that were missed are left out.
  me.deadline_us += foldcar::kTickUs;
  if (me.deadline_us <= now_us) me.deadline_us = now_us + foldcar::kTickUs;
  me.application.tick();
  me.console.poll(now_us);
}
