// Fake of ESP-IDF 4.4: the timer that counts microseconds since start in 64 bits, and timers that call back once.
#pragma once

#include "fake_esp32.h"

constexpr esp_err_t ESP_ERR_NO_MEM = 0x101, ESP_ERR_INVALID_STATE = 0x103;
using esp_timer_handle_t = FakeTimer*;
enum esp_timer_dispatch_t { ESP_TIMER_TASK };
struct esp_timer_create_args_t {
  void (*callback)(void*);
  void* arg;
  esp_timer_dispatch_t dispatch_method;
  const char* name;
  bool skip_unhandled_events;
};

inline std::int64_t esp_timer_get_time() { return fake_esp32.time_us; }

inline esp_err_t esp_timer_create(const esp_timer_create_args_t* settings, esp_timer_handle_t* timer) {
  if (fake_esp32.heap_is_full) return ESP_ERR_NO_MEM;
  fake_esp32.timers.push_back({settings->callback, settings->arg});
  *timer = &fake_esp32.timers.back();
  return ESP_OK;
}

inline esp_err_t esp_timer_start_once(esp_timer_handle_t timer, std::uint64_t timeout_us) {
  if (timer->due_us >= 0 || fake_esp32.timers_fail) return ESP_ERR_INVALID_STATE;
  timer->due_us = fake_esp32.time_us + static_cast<std::int64_t>(timeout_us);
  return ESP_OK;
}

inline esp_err_t esp_timer_stop(esp_timer_handle_t timer) {
  if (timer->due_us < 0) return ESP_ERR_INVALID_STATE;
  timer->due_us = -1;
  return ESP_OK;
}
