// Fake of ESP-IDF 4.4: reset reasons, restart, and the end of a program that has failed.
#pragma once

#include "fake_esp32.h"

enum esp_reset_reason_t {
  ESP_RST_UNKNOWN,
  ESP_RST_POWERON,
  ESP_RST_EXT,
  ESP_RST_SW,
  ESP_RST_PANIC,
  ESP_RST_INT_WDT,
  ESP_RST_TASK_WDT,
  ESP_RST_WDT,
  ESP_RST_DEEPSLEEP,
  ESP_RST_BROWNOUT,
  ESP_RST_SDIO
};

inline esp_reset_reason_t esp_reset_reason() { return static_cast<esp_reset_reason_t>(fake_esp32.reset_reason); }

[[noreturn]] inline void esp_restart() { throw FakeRestart(); }
[[noreturn]] inline void esp_system_abort(const char*) { throw FakeRestart(); }
