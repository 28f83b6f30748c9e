// The HAL of the real car: HUZZAH32 Feather and Servo FeatherWing. The only library that knows Arduino.
#pragma once

#include "feather_board.h"
#include "feather_servos.h"
#include "hal.h"

namespace foldcar {

struct FeatherHal {
  FeatherClock clock;
  FeatherServos servos;
  FeatherBattery battery;
  SerialLink link;
  FlashStorage storage;

  Hal hal() { return {clock, servos, battery, link, storage}; }
};

}  // namespace foldcar
