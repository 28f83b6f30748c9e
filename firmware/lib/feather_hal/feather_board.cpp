#include "feather_board.h"

#include <Arduino.h>
#include <esp_idf_version.h>
#include <esp_system.h>
#include <esp_task_wdt.h>
#include <esp_timer.h>

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

constexpr std::uint8_t kBatteryPin = 35;  // A13
constexpr float kBatteryDivider = 2.0f;  // 100k over 100k
constexpr std::uint32_t kWatchdogS = 1;
// More than a host sends at once; a parameter set takes 37 bytes.
constexpr std::size_t kReceiveBufferSize = 1024;

}  // namespace

std::uint64_t FeatherClock::now_us() const { return static_cast<std::uint64_t>(esp_timer_get_time()); }

float FeatherBattery::voltage_v() {
  const std::uint32_t pin_mv = analogReadMilliVolts(kBatteryPin);
  // The core answers 0 if a conversion fails; a board that runs has no battery of 0 V.
  if (pin_mv == 0) return NAN;
  return kBatteryDivider * 0.001f * static_cast<float>(pin_mv);
}

void SerialLink::begin(std::uint32_t baud) {
  Serial.setRxBufferSize(kReceiveBufferSize);  // has an effect only before begin
  Serial.begin(baud);
}

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

void Esp32Board::start_watchdog() {
#if ESP_IDF_VERSION_MAJOR >= 5
  esp_task_wdt_config_t config = {};
  config.timeout_ms = 1000 * kWatchdogS;
  config.trigger_panic = true;
  if (esp_task_wdt_reconfigure(&config) != ESP_OK) esp_task_wdt_init(&config);
#else
  esp_task_wdt_init(kWatchdogS, true);
#endif
  // The core feeds it after every loop().
  enableLoopWDT();
}

ResetReason Esp32Board::reset_reason() const { return static_cast<ResetReason>(esp_reset_reason()); }

void Esp32Board::restart() {
  Serial.flush();
  esp_restart();
}

}  // namespace foldcar
