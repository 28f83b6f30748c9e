// The HAL of the real car: HUZZAH32 Feather and Servo FeatherWing. This library alone includes Arduino's headers.
#pragma once

#include "background_task.h"
#include "feather_board.h"
#include "feather_imu.h"
#include "feather_servos.h"
#include "flash_logs.h"
#include "flash_storage.h"
#include "hal.h"
#include "parameters.h"

namespace foldcar {

struct FeatherHal {
  FeatherClock clock;
  FeatherServos servos;
  FeatherBattery battery{35, 2.0f};        // A13: the LiPo, halved by the board
  FeatherBattery servo_battery{34, 0.0f};  // A2: an option
  SerialLink link;
  FlashStorage storage;
  FeatherImu imu;
  FlashLogs logs;
  Esp32Board board;

  Hal hal() { return {clock, servos, battery, servo_battery, link, storage, imu, logs, board}; }

  // Starts every part. The servos come first, because their outputs may still be driving from before a reset; their bus is
  // the IMU's too. A part that does not start fails at its first use: the application's first write then latches a bus
  // fault, and unreadable flash memory is a fault at the start. baud: bits per second of the USB serial port.
  void begin(std::uint32_t baud) {
    servos.begin();
    link.begin(baud);
    imu.begin();
    storage.begin();
    logs.begin();
    board.begin();
  }

  // Obeys the parameters that describe the board itself. They are read here only, at the start.
  void apply(const Parameters& parameters) {
    if (parameters.get(Parameter::kOeWired) == 1.0f) servos.use_output_enable();
    if (parameters.get(Parameter::kButtonWired) == 1.0f) board.use_button();
    servo_battery.set_divider(parameters.get(Parameter::kServoDivider));
    servos.set_oscillator_hz(parameters.get(Parameter::kPwmOscHz));
  }
};

}  // namespace foldcar
