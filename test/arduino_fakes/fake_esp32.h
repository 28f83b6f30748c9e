// The state behind the Arduino fakes: one ESP32 with what is connected to it. Tests set and read it.
//
// The other headers of this folder declare those calls of Arduino-ESP32 2.0.17 and of Adafruit's libraries that the board's
// HAL makes, with their names, types and documented behaviour, and act on this state. `fake_esp32 = {}` is a new board.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <set>
#include <string>
#include <vector>

// A chip on the I2C bus. write takes the bytes of one transmission, the register's address first; it returns false for a
// byte that the chip does not acknowledge. read gives the next byte.
class I2cChip {
 public:
  virtual ~I2cChip() = default;
  virtual bool write(const std::vector<std::uint8_t>& bytes) = 0;
  virtual std::uint8_t read() = 0;
};

struct FakeI2c {
  std::map<std::uint8_t, I2cChip*> chips;  // by their 7-bit address
  bool driver_fails = false;               // Wire.begin() fails
  bool bus_hangs = false;                  // a line is held low: every transfer ends with a time-out
  int fails_at = -1;                       // one transfer fails after that many; -1: none
  bool begun = false;
  int sda = -1, scl = -1;
  std::uint32_t clock_hz = 0;
  std::uint16_t time_out_ms = 50;
  // Of the transfer that is being put together, and of the last one that was read.
  std::uint8_t address = 0;
  std::vector<std::uint8_t> sending;
  bool repeated_start = false;
  std::deque<std::uint8_t> received;
};

struct FakeUart {
  std::deque<std::uint8_t> receive_buffer;
  std::size_t receive_capacity = 256;
  std::string transmitted;
  std::size_t transmit_fifo = 0;  // bytes in the FIFO of 128, not sent yet
  unsigned long baud = 0;         // 0 before begin
  bool write_waited = false;      // a write found the FIFO full
  bool flushed = false;
};

struct FakeFlash {
  bool nvs_is_broken = false;
  bool nvs_is_open = false;
  bool nvs_is_full = false;
  std::map<std::string, std::map<std::string, std::vector<std::uint8_t>>> nvs;  // by namespace and key
  bool is_formatted = true;   // the partition holds a file system
  bool is_mounted = false;
  bool write_fails = false;  // nothing is programmed or erased any more
  bool read_fails = false;  // a file gives fewer bytes than it has
  std::map<std::string, std::string> files;  // by path
  std::vector<std::uint8_t> logs = std::vector<std::uint8_t>(0x140000, 0x5A);  // the partition of that name; empty: there is none
  int programmed_count = 0, erased_count = 0;  // pages or parts of them, and blocks, of the logs
};

struct FakeTask {
  void (*function)(void*) = nullptr;  // null: none was made
  void* argument = nullptr;
  std::uint32_t stack_size = 0;  // bytes
  unsigned priority = 0;
  int core = -1;
  std::uint32_t delay_ms = 0;  // the last one
};

// A timer of the SDK; one that is created stays.
struct FakeTimer {
  void (*callback)(void*) = nullptr;
  void* argument = nullptr;
  std::int64_t due_us = -1;  // -1: it does not run
};

// What calls of the SDK return.
using esp_err_t = int;
constexpr esp_err_t ESP_OK = 0;

struct FakeEsp32 {
  std::int64_t time_us = 0;
  std::uint32_t pin_mv[40] = {};  // voltage (mV) at each analogue input
  std::map<int, int> pin_modes;       // by pin, of those that were set
  std::set<int> grounded_pins;        // by something outside, such as a button
  std::map<int, int> written_levels;  // by pin
  std::map<int, int> pin_levels;      // of the pins that are outputs
  std::deque<FakeTimer> timers;    // their handles point here
  bool timers_fail = false;        // none starts any more
  int reset_reason = 1;
  int reset_hint = 0;  // 0: none was given
  void (*tick_hook)() = nullptr;  // called at each millisecond of fake time
  const void* loop_stack_top = nullptr;
  std::deque<std::uint32_t> return_addresses;  // of the callers' callers, as in the stack
  std::uint32_t watchdog_s = 0;  // 0 before its initialisation
  bool watchdog_panics = false;
  bool watchdog_guards_loop = false;
  int log_level = 1;  // of the SDK's libraries: errors
  bool heap_is_full = false;
  FakeTask task;
  FakeI2c i2c;
  FakeUart uart;
  FakeFlash flash;
};

inline FakeEsp32 fake_esp32;

// Sets a pin's register, and its level if it is an output.
inline void write_fake_pin(int pin, int level) {
  fake_esp32.written_levels[pin] = level;
  if (fake_esp32.pin_levels.count(pin) > 0) fake_esp32.pin_levels[pin] = level;
}

// Lets time pass in which loop() does nothing: timers and ticks go on.
inline void pass_fake_time(std::int64_t us) {
  const std::int64_t ticks = (fake_esp32.time_us + us) / 1000 - fake_esp32.time_us / 1000;
  fake_esp32.time_us += us;
  for (std::int64_t tick = 0; tick < ticks && fake_esp32.tick_hook != nullptr; ++tick) fake_esp32.tick_hook();
  for (FakeTimer& timer : fake_esp32.timers) {
    if (timer.due_us < 0 || timer.due_us > fake_esp32.time_us) continue;
    timer.due_us = -1;
    timer.callback(timer.argument);
  }
}

// esp_restart() does not return; the fake leaves it with this exception.
struct FakeRestart {};
