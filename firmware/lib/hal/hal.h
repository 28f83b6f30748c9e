// The hardware abstraction layer (HAL): everything that the portable firmware may ask of a board.
//
// The interfaces carry physical values (microseconds, volts, bytes), never registers or timer ticks. They have no default
// bodies and are passed by reference, so that many cars fit in one process. Implementations: feather_hal (the real
// board), sim_hal (a simulated one). test/hal_contract.h checks these promises on every implementation.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "log_numbers.h"

namespace foldcar {

// Outputs of the servo driver; a car uses 2 to 8 of them, one for each wheel.
constexpr std::size_t kChannelCount = 8;

// Pulse width (µs) of each output, sent at 50 Hz. An output with kNoPulse stays low: the servo neither drives nor holds.
using PulsesUs = std::array<float, kChannelCount>;
constexpr float kNoPulse = 0.0f;
// Longest pulse (µs) that a servo driver must be able to send; longer ones are refused.
constexpr float kLongestOutputUs = 3000.0f;

class Clock {
 public:
  virtual ~Clock() = default;
  // Time since start (µs). It never decreases and, having 64 bits, never wraps.
  virtual std::uint64_t now_us() const = 0;
};

class WheelServos {
 public:
  virtual ~WheelServos() = default;
  // Sets every output. Returns false, with the outputs unchanged, if a pulse width is outside 0 to kLongestOutputUs or not
  // a number; false, with the outputs unknown, if the driver did not acknowledge the write (a bus error).
  virtual bool write_pulses(const PulsesUs& pulses_us) = 0;
};

class Battery {
 public:
  virtual ~Battery() = default;
  // Terminal voltage (V); NaN if it cannot be read.
  virtual float voltage_v() = 0;
};

class ByteLink {
 public:
  virtual ~ByteLink() = default;
  // Take up to size bytes that have arrived, or send up to size bytes. Both return the number of bytes moved (0 to size)
  // and never wait.
  virtual std::size_t read(std::uint8_t* data, std::size_t size) = 0;
  virtual std::size_t write(const std::uint8_t* data, std::size_t size) = 0;
};

// Named numbers that survive a reset. A name has 1 to 15 characters (the limit of the ESP32's flash keys).
class Storage {
 public:
  virtual ~Storage() = default;
  // Whether numbers can be stored at all. If not, every other call returns false.
  virtual bool present() const = 0;
  // Returns false, with value unchanged, if nothing is stored under that name.
  virtual bool load(const char* name, float& value) = 0;
  // Returns false if the value could not be stored.
  virtual bool save(const char* name, float value) = 0;
  // Deletes every stored number. Returns false if it could not.
  virtual bool clear() = 0;
};

// One measurement in the car's axes: x forward, y left, z up. At rest on level ground the acceleration is (0, 0, 9.81).
struct ImuSample {
  std::array<float, 3> acceleration_m_s2{};
  std::array<float, 3> rate_rad_s{};
};

class Imu {
 public:
  virtual ~Imu() = default;
  // Whether an IMU was found at the start. A car can do without one.
  virtual bool present() const = 0;
  // Returns false, with sample unchanged, if there is no IMU or it does not answer.
  virtual bool read(ImuSample& sample) = 0;
};

// The number of logs that are kept, and the bytes that each may have.
constexpr std::uint16_t kLogsKept = 4;
constexpr std::size_t kLogSize = 250000;

// Logs of trials: sequences of bytes that survive a reset, each under its own number from 1 on.
class LogStorage {
 public:
  virtual ~LogStorage() = default;
  // Whether logs can be stored at all. If not, every other call returns false or 0.
  virtual bool present() const = 0;
  // Makes room for the next log and gives it its number, the one after the newest log's (log_numbers.h); removes the oldest of
  // more than kLogsKept. Does one thing, which may stop both cores of a board for 0.4 s. Returns whether there is more to do.
  virtual bool prepare() = 0;
  // Opens the log that was prepared for append, and returns its number; 0 without prepared room, or if storage fails. Nothing
  // is written. The calls below take a few milliseconds at most.
  virtual std::uint16_t create() = 0;
  // Adds size bytes to the open log. Returns false if none is open, the log is full or storage is seen to fail; the size of
  // the closed log tells what it has taken. A reset costs less than the last 256 bytes.
  virtual bool append(const std::uint8_t* data, std::size_t size) = 0;
  // Closes the open log, which is complete from then on. Returns false if none is open.
  virtual bool close() = 0;
  // Size (bytes) of a closed log; 0 if there is no such log.
  virtual std::size_t size(std::uint16_t id) = 0;
  // Copies up to size bytes of a closed log, from offset (bytes) on, and returns their number; 0 behind its end.
  virtual std::size_t read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) = 0;
  // Deletes a closed log. Returns false if there is no such log.
  virtual bool remove(std::uint16_t id) = 0;
  // The oldest and the newest log; both 0 without any. A log may be missing between them, and one that has just been created
  // counts.
  virtual LogRange range() const = 0;
};

// Why the board has started, numbered as the ESP32 does (esp_reset_reason).
enum class ResetReason : std::uint8_t {
  kUnknown = 0,
  kPowerOn = 1,
  kExternalPin = 2,
  kSoftware = 3,
  kCrash = 4,
  kInterruptWatchdog = 5,
  kTaskWatchdog = 6,
  kOtherWatchdog = 7,
  kDeepSleep = 8,
  kBrownOut = 9
};

// Where the program was when a crash or a watchdog ended it.
struct CrashReport {
  static constexpr std::size_t kMaxAddresses = 12;
  static constexpr std::uint8_t kNoException = 255;

  // Number of the processor's exception (Xtensa's EXCCAUSE); kNoException if the program ended itself, or a watchdog did.
  std::uint8_t cause = kNoException;
  std::uint32_t data_address = 0;  // which the exception is about, if any
  // Addresses in the program: where it was, its caller, and so on; 0 behind the last.
  std::uint32_t addresses[kMaxAddresses] = {};
};

class Board {
 public:
  virtual ~Board() = default;
  // The same answer until the next restart.
  virtual ResetReason reset_reason() const = 0;
  // What ended the run before this one; null if that was no crash, or nothing is known of it. Likewise the same.
  virtual const CrashReport* crash_report() const = 0;
  // Restarts the board. A simulated board returns from this call; its stepper restarts the firmware.
  virtual void restart() = 0;
  // The board's light-emitting diode.
  virtual void set_led(bool on) = 0;
  // Whether the car's button is pressed, without debouncing; false on a car without one.
  virtual bool button_is_pressed() = 0;
  // Whether this is a simulator and no board: whoever keeps results must be able to tell them apart.
  virtual bool is_simulated() const = 0;
};

// All parts of one board. Each board assembles its own in one place: FeatherHal::hal(), BasicSimHal::hal().
struct Hal {
  Clock& clock;
  WheelServos& servos;
  Battery& battery;        // supplies the board
  Battery& servo_battery;  // NaN also on a car that does not measure it
  ByteLink& link;
  Storage& storage;
  Imu& imu;
  LogStorage& logs;
  Board& board;
};

}  // namespace foldcar
