#include "feather_board.h"

#include <Arduino.h>
#include <esp_timer.h>

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

constexpr std::uint8_t kBatteryPin = 35;  // A13
constexpr float kBatteryDivider = 2.0f;  // 100k over 100k

}  // namespace

std::uint64_t FeatherClock::now_us() const { return static_cast<std::uint64_t>(esp_timer_get_time()); }

float FeatherBattery::voltage_v() {
  const std::uint32_t pin_mv = analogReadMilliVolts(kBatteryPin);
  // The core answers 0 if a conversion fails; a board that runs has no battery of 0 V.
  if (pin_mv == 0) return NAN;
  return kBatteryDivider * 0.001f * static_cast<float>(pin_mv);
}

void SerialLink::begin(std::uint32_t baud) { Serial.begin(baud); }

std::size_t SerialLink::read(std::uint8_t* data, std::size_t size) {
  std::size_t count = 0;
  while (count < size && Serial.available() > 0) data[count++] = static_cast<std::uint8_t>(Serial.read());
  return count;
}

// Serial.write waits for room in the transmit FIFO, so no more is given to it than there is room for.
std::size_t SerialLink::write(const std::uint8_t* data, std::size_t size) {
  const auto room = static_cast<std::size_t>(std::max<int>(Serial.availableForWrite(), 0));
  const std::size_t count = std::min<std::size_t>(size, room);
  return count == 0 ? 0 : Serial.write(data, count);
}

bool FlashStorage::begin() { return preferences_.begin("foldcar", false); }

bool FlashStorage::load(const char* name, float& value) {
  float stored = 0.0f;
  // Asking first keeps the core from logging an error for each parameter that was never saved.
  if (!preferences_.isKey(name)) return false;
  if (preferences_.getBytes(name, &stored, sizeof stored) != sizeof stored) return false;
  value = stored;
  return true;
}

bool FlashStorage::save(const char* name, float value) {
  return preferences_.putBytes(name, &value, sizeof value) == sizeof value;
}

}  // namespace foldcar
