// The hardware seam: everything the portable firmware may ask of a board.
//
// Interfaces carry physical values (microseconds, volts, bytes), never registers or ticks. They have no
// default bodies and are passed by reference, so that many cars fit in one process. Implementations:
// feather_hal (the real board) and sim_hal (the simulated one). One contract test runs over every one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace foldcar {

// Outputs of the servo driver; a car uses the first 2 to 8 of them, one a wheel.
constexpr std::size_t kChannelCount = 8;

// Pulse width of each output in microseconds; kNoPulse leaves the output low, so the servo is unpowered
// in the sense of the signal: it neither drives nor holds.
using PulsesUs = std::array<float, kChannelCount>;
constexpr float kNoPulse = 0.0f;

class Clock {
 public:
  virtual ~Clock() = default;
  // Microseconds since start, never decreasing.
  virtual std::uint64_t now_us() const = 0;
};

class WheelServos {
 public:
  virtual ~WheelServos() = default;
  // Sets every output. False if the driver did not take it (a bus error); outputs are then unknown.
  virtual bool write_pulses(const PulsesUs& pulses_us) = 0;
};

class Battery {
 public:
  virtual ~Battery() = default;
  // Terminal voltage in volts; NaN if it cannot be read.
  virtual float voltage_v() = 0;
};

class ByteLink {
 public:
  virtual ~ByteLink() = default;
  // Both return how many bytes were moved, 0 to size, and never wait.
  virtual std::size_t read(std::uint8_t* data, std::size_t size) = 0;
  virtual std::size_t write(const std::uint8_t* data, std::size_t size) = 0;
};

class Storage {
 public:
  virtual ~Storage() = default;
  // Named numbers that outlive a reset. load returns false, and leaves value alone, if there is none.
  virtual bool load(const char* name, float& value) = 0;
  virtual bool save(const char* name, float value) = 0;
  // Forgets all of them.
  virtual bool clear() = 0;
};

// In the car's axes: x forward, y left, z up. At rest on the level the acceleration is (0, 0, 9.81).
struct ImuSample {
  std::array<float, 3> acceleration_m_s2{};
  std::array<float, 3> rate_rad_s{};
};

class Imu {
 public:
  virtual ~Imu() = default;
  // Whether one was found at the start; a car needs none.
  virtual bool present() const = 0;
  // False, and sample left alone, if it does not answer.
  virtual bool read(ImuSample& sample) = 0;
};

// What is recorded of trials: logs of bytes that outlive a reset, each under its own number.
class LogStorage {
 public:
  virtual ~LogStorage() = default;
  // Whether there is anything to record to.
  virtual bool present() const = 0;
  // Begins an empty log and keeps it open for append; close makes sure that all of it is stored.
  virtual bool create(std::uint16_t id) = 0;
  virtual bool append(const std::uint8_t* data, std::size_t size) = 0;
  virtual bool close() = 0;
  // Bytes in a log; 0 if there is no such log.
  virtual std::size_t size(std::uint16_t id) = 0;
  // Up to size bytes from offset on; how many there were.
  virtual std::size_t read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) = 0;
  virtual bool remove(std::uint16_t id) = 0;
  // The smallest and the largest number of a log; false if there is none.
  virtual bool range(std::uint16_t& first, std::uint16_t& last) = 0;
};

// Why the board has started, as the ESP32 counts its reasons (esp_reset_reason).
enum class ResetReason : std::uint8_t {
  kUnknown = 0,
  kPowerOn = 1,
  kSoftware = 3,
  kCrash = 4,
  kInterruptWatchdog = 5,
  kTaskWatchdog = 6,
  kOtherWatchdog = 7,
  kBrownOut = 9
};

class Board {
 public:
  virtual ~Board() = default;
  virtual ResetReason reset_reason() const = 0;
  // Restarts the board. A simulated one returns and is restarted by its stepper.
  virtual void restart() = 0;
};

struct Hal {
  Clock& clock;
  WheelServos& servos;
  Battery& battery;
  ByteLink& link;
  Storage& storage;
  Imu& imu;
  LogStorage& logs;
  Board& board;
};

}  // namespace foldcar
