#include "feather_board.h"

#include <Arduino.h>
#include <esp_idf_version.h>
#include <esp_log.h>
#include <esp_system.h>
#include <esp_task_wdt.h>
#include <esp_timer.h>

#include <algorithm>
#include <cmath>

#include "crash_memory.h"
#include "loop_guard.h"

// In the place of the SDK's, by the linker (platformio.ini): the SDK looks for a partition for core dumps at every
// start and complains on the serial port, before anything can tell it not to. The board has none on purpose
// (firmware/partitions.csv).
extern "C" void __wrap_esp_core_dump_init() {}  // NOLINT(bugprone-reserved-identifier)

namespace foldcar {
namespace {

constexpr std::uint8_t kLedPin = 13;
constexpr std::uint8_t kButtonPin = 32;
// No battery that works has so little (V): the divider is broken, or the battery switched off. A pin without voltage
// reads 142 mV, 0.28 V behind a divider by 2.
constexpr float kLowestCellV = 1.0f;
constexpr std::uint32_t kWatchdogS = 1;
// Bytes; more than a host sends between two polls. A PARAM_SET packet has 37.
constexpr std::size_t kReceiveBufferSize = 1024;

}  // namespace

std::uint64_t FeatherClock::now_us() const { return static_cast<std::uint64_t>(esp_timer_get_time()); }

float FeatherBattery::voltage_v() {
  if (divider_ == 0.0f) return NAN;
  const float volts = divider_ * 0.001f * static_cast<float>(analogReadMilliVolts(pin_));
  return volts < kLowestCellV ? NAN : volts;
}

// Opens the serial port. The SDK's log is silenced, as it goes to the same port and would break packets.
void SerialLink::begin(std::uint32_t baud) {
  esp_log_level_set("*", ESP_LOG_NONE);
  Serial.setRxBufferSize(kReceiveBufferSize);  // has an effect only before begin
  Serial.begin(baud);
}

std::size_t SerialLink::read(std::uint8_t* data, std::size_t size) {
  std::size_t count = 0;
  while (count < size && Serial.available() > 0) data[count++] = static_cast<std::uint8_t>(Serial.read());
  return count;
}

// Serial.write waits for room in the transmit FIFO, so it is given no more bytes than there is room for.
std::size_t SerialLink::write(const std::uint8_t* data, std::size_t size) {
  const auto room = static_cast<std::size_t>(std::max<int>(Serial.availableForWrite(), 0));
  const std::size_t count = std::min<std::size_t>(size, room);
  return count == 0 ? 0 : Serial.write(data, count);
}

// A report counts only after a crash or a watchdog: its memory is as it was before, or holds anything after a power-on.
void Esp32Board::begin() {
  const bool is_kept = take_crash(crash_report_);
  const ResetReason reason = reset_reason();
  has_crashed_ = is_kept && reason >= ResetReason::kCrash && reason <= ResetReason::kOtherWatchdog;
}

// Sets the SDK's watchdog, which the Arduino core has started for the idle task of core 0, to kWatchdogS, and adds loop()
// to it.
void Esp32Board::start_watchdog() {
  LoopGuard::begin();
#if ESP_IDF_VERSION_MAJOR >= 5
  const esp_task_wdt_config_t settings = {1000 * kWatchdogS, 1, true};
  esp_task_wdt_reconfigure(&settings);
#else
  esp_task_wdt_init(kWatchdogS, true);
#endif
  enableLoopWDT();  // the core feeds it after every loop()
}

void Esp32Board::use_button() {
  pinMode(kButtonPin, INPUT_PULLUP);
  has_button_ = true;
}

bool Esp32Board::button_is_pressed() { return has_button_ && digitalRead(kButtonPin) == LOW; }

void Esp32Board::set_led(bool on) {
  if (!led_is_output_) pinMode(kLedPin, OUTPUT);
  led_is_output_ = true;
  digitalWrite(kLedPin, on ? HIGH : LOW);
}

ResetReason Esp32Board::reset_reason() const {
  const int reason = static_cast<int>(esp_reset_reason());
  return reason <= static_cast<int>(ResetReason::kBrownOut) ? static_cast<ResetReason>(reason) : ResetReason::kUnknown;
}

void Esp32Board::restart() {
  Serial.flush();
  esp_restart();
}

}  // namespace foldcar
