// The HAL of the real car: HUZZAH32 Feather and Servo FeatherWing. The only library that knows Arduino.
#pragma once

#include "feather_board.h"
#include "feather_imu.h"
#include "feather_servos.h"
#include "flash_files.h"
#include "flash_storage.h"
#include "hal.h"

namespace foldcar {

struct FeatherHal {
  FeatherClock clock;
  FeatherServos servos;
  FeatherBattery battery;
  SerialLink link;
  FlashStorage storage;
  FeatherImu imu;
  FlashLogs logs;
  Esp32Board board;

  Hal hal() { return {clock, servos, battery, link, storage, imu, logs, board}; }
};

}  // namespace foldcar
