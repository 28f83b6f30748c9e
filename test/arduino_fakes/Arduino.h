// Fake of Arduino-ESP32 2.0.17: analogue inputs, outputs, the loop's watchdog, delays, Serial.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "esp_attr.h"
#include "fake_esp32.h"

// The calibrated voltage (mV) at a pin; the core returns 0 if the conversion fails.
inline std::uint32_t analogReadMilliVolts(std::uint8_t pin) { return fake_esp32.pin_mv[pin]; }

constexpr int LOW = 0, HIGH = 1, INPUT = 1, OUTPUT = 3, INPUT_PULLUP = 5;
// A pin that becomes an output has the level of its register.
inline void pinMode(std::uint8_t pin, std::uint8_t mode) {
  fake_esp32.pin_modes[pin] = mode;
  if (mode == OUTPUT) fake_esp32.pin_levels[pin] = fake_esp32.written_levels[pin];
}
// As in Arduino-ESP32 3.x, nothing happens before pinMode.
inline void digitalWrite(std::uint8_t pin, std::uint8_t level) {
  if (fake_esp32.pin_modes.count(pin) > 0) write_fake_pin(pin, level);
}
// An input with a pull-up is high unless something connects it to ground.
inline int digitalRead(std::uint8_t pin) { return fake_esp32.grounded_pins.count(pin) > 0 ? LOW : HIGH; }

inline void delay(std::uint32_t ms) { pass_fake_time(1000 * static_cast<std::int64_t>(ms)); }

// Adds the task that runs loop() to the task watchdog; the core feeds it after each loop().
inline void enableLoopWDT() { fake_esp32.watchdog_guards_loop = true; }

class HardwareSerial {
 public:
  // Has an effect only before begin. Returns the size that holds from then on.
  std::size_t setRxBufferSize(std::size_t size) {
    if (fake_esp32.uart.baud != 0) return 0;
    return fake_esp32.uart.receive_capacity = size;
  }
  void begin(unsigned long baud) { fake_esp32.uart.baud = baud; }

  int available() { return static_cast<int>(fake_esp32.uart.receive_buffer.size()); }
  int read() {
    std::deque<std::uint8_t>& buffer = fake_esp32.uart.receive_buffer;
    if (buffer.empty()) return -1;
    const int byte = buffer.front();
    buffer.pop_front();
    return byte;
  }

  // Room in the transmit FIFO, as no transmit buffer is set.
  int availableForWrite() { return static_cast<int>(kFifo - fake_esp32.uart.transmit_fifo); }
  // Waits until all bytes are in the FIFO.
  std::size_t write(const std::uint8_t* data, std::size_t size) {
    FakeUart& uart = fake_esp32.uart;
    uart.write_waited = uart.write_waited || size > kFifo - uart.transmit_fifo;
    uart.transmitted.append(reinterpret_cast<const char*>(data), size);
    uart.transmit_fifo = std::min(kFifo, uart.transmit_fifo + size);
    return size;
  }
  // Waits until all bytes are sent.
  void flush() {
    fake_esp32.uart.transmit_fifo = 0;
    fake_esp32.uart.flushed = true;
  }

 private:
  static constexpr std::size_t kFifo = 128;
};

inline HardwareSerial Serial;
