// Fake of ESP-IDF 4.4: the task watchdog.
#pragma once

#include "fake_esp32.h"

// Time-out in seconds; panic: a task that is late restarts the board.
inline esp_err_t esp_task_wdt_init(std::uint32_t timeout_s, bool panic) {
  fake_esp32.watchdog_s = timeout_s;
  fake_esp32.watchdog_panics = panic;
  return ESP_OK;
}
