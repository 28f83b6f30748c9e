// Fake of ESP-IDF 4.4: a function that the tick interrupt of this core calls.
#pragma once

#include "esp_timer.h"

inline esp_err_t esp_register_freertos_tick_hook(void (*hook)()) {
  if (fake_esp32.heap_is_full) return ESP_ERR_NO_MEM;
  fake_esp32.tick_hook = hook;
  return ESP_OK;
}
