// Fake of ESP-IDF 4.4: the task watchdog.
#pragma once

#include "fake_esp32.h"

// Of ESP-IDF 5, which Arduino-ESP32 3 brings.
struct esp_task_wdt_config_t {
  std::uint32_t timeout_ms;
  std::uint32_t idle_core_mask;
  bool trigger_panic;
};
inline esp_err_t esp_task_wdt_reconfigure(const esp_task_wdt_config_t* config) {
  fake_esp32.watchdog_s = config->timeout_ms / 1000;
  fake_esp32.watchdog_panics = config->trigger_panic;
  return ESP_OK;
}

// Time-out in seconds; panic: a task that is late restarts the board.
inline esp_err_t esp_task_wdt_init(std::uint32_t timeout_s, bool panic) {
  fake_esp32.watchdog_s = timeout_s;
  fake_esp32.watchdog_panics = panic;
  return ESP_OK;
}
