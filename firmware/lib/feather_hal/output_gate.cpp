#include "output_gate.h"

#include <Arduino.h>
#include <soc/gpio_struct.h>

namespace foldcar {
namespace {

constexpr std::uint32_t kPinBit = 1u << OutputGate::kPin;

void disable_output_late(void*) { OutputGate::disable_output(); }

}  // namespace

// By the GPIO register itself: it holds its level before the pin is an output, through a crash and through a restart of
// the processors, and can be written while flash is off.
IRAM_ATTR void OutputGate::disable_output() { GPIO.out_w1ts = kPinBit; }

bool OutputGate::begin() {
  is_used_ = true;
  disable_output();  // before the pin is an output, so that it is never driven low here
  pinMode(kPin, OUTPUT);
  esp_timer_create_args_t settings{};
  settings.callback = disable_output_late;
  settings.name = "output gate";
  return esp_timer_create(&settings, &timer_) == ESP_OK;
}

// Enables the servo driver's outputs for kHoldUs, after which a timer disables them unless this is called again. Disables
// them if there is no such timer.
bool OutputGate::open() {
  if (!is_used_) return true;
  if (timer_ == nullptr) return false;
  esp_timer_stop(timer_);  // fails if it does not run
  if (esp_timer_start_once(timer_, kHoldUs) != ESP_OK) {
    disable_output();
    return false;
  }
  GPIO.out_w1tc = kPinBit;
  return true;
}

void OutputGate::close() {
  if (!is_used_) return;
  disable_output();
  if (timer_ != nullptr) esp_timer_stop(timer_);
}

}  // namespace foldcar

// In the place of the SDK's, by the linker (platformio.ini): the SDK restarts the processors without a reset of the
// pins, at a dip of the supply and after a crash, whose handler is in crash_memory.cpp. In RAM, because flash may be off.
// NOLINTBEGIN(bugprone-reserved-identifier)
extern "C" [[noreturn]] void __real_esp_restart_noos();

extern "C" [[noreturn]] IRAM_ATTR void __wrap_esp_restart_noos() {
  foldcar::OutputGate::disable_output();
  __real_esp_restart_noos();
}
// NOLINTEND(bugprone-reserved-identifier)
