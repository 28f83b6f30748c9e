// Fake of ESP-IDF 4.4: what the next start is to give as the reason of a reset.
#pragma once

#include "../esp_system.h"

inline void esp_reset_reason_set_hint(esp_reset_reason_t hint) { fake_esp32.reset_hint = hint; }
