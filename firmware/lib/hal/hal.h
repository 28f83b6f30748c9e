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
};

struct Hal {
  Clock& clock;
  WheelServos& servos;
  Battery& battery;
  ByteLink& link;
  Storage& storage;
};

}  // namespace foldcar
