// The HAL of a simulated car: time is the stepper's, servos and battery are the world's.
//
// One object a car; nothing is shared between cars.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "hal.h"

namespace foldcar {

class SimClock : public Clock {
 public:
  std::uint64_t now_us() const override { return now_us_; }
  void advance_to_us(std::uint64_t t_us) { now_us_ = t_us; }

 private:
  std::uint64_t now_us_ = 0;
};

class SimServos : public WheelServos {
 public:
  bool write_pulses(const PulsesUs& pulses_us) override;
  const PulsesUs& pulses_us() const { return pulses_us_; }
  // A bus that does not answer takes no writes; the driver goes on with the pulses it has.
  bool answers = true;

 private:
  PulsesUs pulses_us_{};
};

// The logic's own cell, which the servos do not load: the voltage that it is set to.
class SimBattery : public Battery {
 public:
  explicit SimBattery(double voltage_v) { set_v(voltage_v); }
  float voltage_v() override { return voltage_v_; }
  void set_v(double voltage_v) { voltage_v_ = static_cast<float>(voltage_v); }

 private:
  float voltage_v_ = 0;
};

// Bytes to and from whoever plays the other end: to_car is read by the firmware, from_car was written by it.
class SimLink : public ByteLink {
 public:
  std::size_t read(std::uint8_t* data, std::size_t size) override;
  std::size_t write(const std::uint8_t* data, std::size_t size) override;
  std::vector<std::uint8_t> to_car;
  std::vector<std::uint8_t> from_car;
};

// Flash that lives as long as the object.
class SimStorage : public Storage {
 public:
  bool load(const char* name, float& value) override;
  bool save(const char* name, float value) override;
  bool clear() override;

 private:
  std::map<std::string, float> values_;
};

// A sensor that the world around it sets; a car without one is the rule.
class SimImu : public Imu {
 public:
  bool present() const override { return fitted; }
  bool read(ImuSample& sample) override;
  bool fitted = false;
  bool answers = true;
  ImuSample now;
};

// Logs that live as long as the object.
class SimLogs : public LogStorage {
 public:
  bool present() const override { return fitted; }
  bool create(std::uint16_t id) override;
  bool append(const std::uint8_t* data, std::size_t size) override;
  bool close() override;
  std::size_t size(std::uint16_t id) override;
  std::size_t read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) override;
  bool remove(std::uint16_t id) override;
  bool range(std::uint16_t& first, std::uint16_t& last) override;
  bool fitted = false;

 private:
  std::map<std::uint16_t, std::vector<std::uint8_t>> logs_;
  std::uint16_t open_ = 0;
};

class SimBoard : public Board {
 public:
  ResetReason reset_reason() const override { return reason; }
  void restart() override { restart_is_asked = true; }
  ResetReason reason = ResetReason::kPowerOn;
  bool restart_is_asked = false;
};

struct SimHal {
  explicit SimHal(double battery_v) : battery(battery_v) {}
  Hal hal() { return {clock, servos, battery, link, storage, imu, logs, board}; }
  SimClock clock;
  SimServos servos;
  SimBattery battery;
  SimLink link;
  SimStorage storage;
  SimImu imu;
  SimLogs logs;
  SimBoard board;
};

}  // namespace foldcar
