// Fake of ESP-IDF 4.4: the timer that counts microseconds since start in 64 bits.
#pragma once

#include "fake_esp32.h"

inline std::int64_t esp_timer_get_time() { return fake_esp32.time_us; }
