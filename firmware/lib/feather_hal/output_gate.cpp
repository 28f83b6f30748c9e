#include "output_gate.h"

#include <Arduino.h>

namespace foldcar {
namespace {

void disable_output(void*) { digitalWrite(OutputGate::kPin, HIGH); }

}  // namespace

// The level is set first, so that the pin is never driven low here.
bool OutputGate::begin() {
  is_used_ = true;
  disable_output(nullptr);
  pinMode(kPin, OUTPUT);
  esp_timer_create_args_t settings{};
  settings.callback = disable_output;
  settings.name = "output gate";
  return esp_timer_create(&settings, &timer_) == ESP_OK;
}

bool OutputGate::open() {
  if (!is_used_) return true;
  if (timer_ == nullptr) return false;
  esp_timer_stop(timer_);  // fails if it does not run
  if (esp_timer_start_once(timer_, kHoldUs) != ESP_OK) return false;
  digitalWrite(kPin, LOW);
  return true;
}

void OutputGate::close() {
  if (!is_used_) return;
  disable_output(nullptr);
  if (timer_ != nullptr) esp_timer_stop(timer_);
}

}  // namespace foldcar
