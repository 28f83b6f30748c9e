#include "feather_servos.h"

#include <Arduino.h>
#include <Wire.h>

#include <cmath>
#include <cstdint>

#include "loop_guard.h"

namespace foldcar {
namespace {

constexpr std::uint8_t kAddress = 0x40;
constexpr int kSdaPin = 23;
constexpr int kSclPin = 22;
constexpr std::uint32_t kBusHz = 400000;
// A write takes 0.8 ms. A bus that fails should not delay the loop by more than half a tick, in kAttempts. The SDK's
// driver may wait for up to 1 s all the same where its own state machine hangs; the guard of loop() then restarts the board.
constexpr std::uint16_t kBusTimeOutMs = 5;
// Erasing flash stops both cores of the ESP32 for about 45 ms. A transfer that it interrupts times out.
constexpr int kAttempts = 2;
constexpr float kPulseRateHz = 50.0f;
constexpr std::uint16_t kTicksPerPeriod = 4096;

// LED0_ON_L. Each output has four registers: on and off time, low byte first. The driver's setPWMFreq() has set the
// bit by which the register address increments.
constexpr std::uint8_t kFirstOutputRegister = 0x06;
// ALL_LED_OFF_H with its full-off bit: this one register turns every output off, whatever its pulse.
constexpr std::uint8_t kAllOffRegister = 0xFD;
constexpr std::uint8_t kFullOff = 0x10;

}  // namespace

FeatherServos::FeatherServos() : driver_(kAddress, Wire) {}

// Opens the I2C bus and starts the chip with its outputs off. They are turned off first, because the driver's begin()
// restarts the chip at 1 kHz with the outputs as they are. Wire is begun here, because another begin() on a running
// bus changes neither pins nor frequency.
bool FeatherServos::begin() {
  bus_open_ = Wire.begin(kSdaPin, kSclPin, kBusHz);
  Wire.setTimeOut(kBusTimeOutMs);
  driver_begun_ = write_off() && driver_.begin();
  return driver_begun_;
}

// Sets the chip's period to 20 ms by the frequency of its oscillator, with the outputs off. Returns whether it could.
bool FeatherServos::set_oscillator_hz(float oscillator_hz) {
  us_per_tick_ = 0.0f;
  if (!driver_begun_ || !write_off()) return false;
  driver_.setOscillatorFrequency(static_cast<std::uint32_t>(oscillator_hz));
  driver_.setPWMFreq(kPulseRateHz);
  // The prescaler is a whole number, so the period is not exactly 20 ms. The driver checks no read; one that failed
  // shows as a rate far from 50 Hz.
  const float us_per_tick = 1e6f * static_cast<float>(driver_.readPrescale() + 1) / oscillator_hz;
  const float rate_hz = 1e6f / (us_per_tick * kTicksPerPeriod);
  if (std::fabs(rate_hz - kPulseRateHz) > 1.0f) return false;
  us_per_tick_ = us_per_tick;
  return true;
}

// Writes all outputs in one transfer, or turns them off if none has a pulse; the gate opens and closes with them. The guard of
// loop() is fed first, as a write may hang.
// Returns whether the chip acknowledged.
bool FeatherServos::write_pulses(const PulsesUs& pulses_us) {
  bool all_off = true;
  for (const float pulse_us : pulses_us) all_off = all_off && pulse_us == kNoPulse;
  LoopGuard::feed(!all_off);
  if (all_off) {
    gate_.close();
    return write_off() && driver_begun_;
  }

  for (const float pulse_us : pulses_us) {
    if (!(pulse_us >= 0.0f && pulse_us <= kLongestOutputUs)) return false;
  }
  if (us_per_tick_ == 0.0f) return false;
  // One transfer, at whose end the chip changes all outputs together.
  std::uint8_t bytes[1 + 4 * kChannelCount] = {kFirstOutputRegister};
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
    const float pulse_us = pulses_us[channel];
    // An off time of a whole period is the chip's full-off bit.
    const std::uint16_t ticks =
        pulse_us == kNoPulse ? kTicksPerPeriod : static_cast<std::uint16_t>(pulse_us / us_per_tick_ + 0.5f);
    bytes[3 + 4 * channel] = static_cast<std::uint8_t>(ticks);
    bytes[4 + 4 * channel] = static_cast<std::uint8_t>(ticks >> 8);
  }
  return write(bytes, sizeof bytes) && gate_.open();
}

bool FeatherServos::write_off() {
  const std::uint8_t bytes[] = {kAllOffRegister, kFullOff};
  return bus_open_ && write(bytes, sizeof bytes);
}

bool FeatherServos::write(const std::uint8_t* bytes, std::size_t size) {
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    Wire.beginTransmission(kAddress);
    if (Wire.write(bytes, size) == size && Wire.endTransmission() == 0) return true;
  }
  return false;
}

}  // namespace foldcar
