// Fake of ESP-IDF 4.4: FreeRTOS's types, with a tick of 1 ms as Arduino-ESP32 sets it.
#pragma once

#include <cstdint>

using BaseType_t = int;
using UBaseType_t = unsigned;
using TickType_t = std::uint32_t;

constexpr std::uint32_t configTICK_RATE_HZ = 1000;
constexpr BaseType_t pdPASS = 1;
constexpr TickType_t pdMS_TO_TICKS(std::uint32_t ms) { return ms; }
