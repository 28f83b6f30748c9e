// Fake of ESP-IDF 4.4: what its libraries print.
#pragma once

#include <string>

#include "fake_esp32.h"

enum esp_log_level_t { ESP_LOG_NONE, ESP_LOG_ERROR, ESP_LOG_WARN, ESP_LOG_INFO, ESP_LOG_DEBUG, ESP_LOG_VERBOSE };

// tag: "*" for all.
inline void esp_log_level_set(const char* tag, esp_log_level_t level) {
  if (std::string(tag) == "*") fake_esp32.log_level = level;
}
