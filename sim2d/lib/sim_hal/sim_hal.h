// The HAL of a simulated car: time is the stepper's, servos and battery are the world's.
//
// One object a car; nothing is shared between cars.
#pragma once

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

 private:
  PulsesUs pulses_us_{};
};

// The logic's own cell, which the servos do not load: a constant voltage.
class SimBattery : public Battery {
 public:
  explicit SimBattery(double voltage_v) : voltage_v_(static_cast<float>(voltage_v)) {}
  float voltage_v() override { return voltage_v_; }

 private:
  float voltage_v_;
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

 private:
  std::map<std::string, float> values_;
};

struct SimHal {
  explicit SimHal(double battery_v) : battery(battery_v) {}
  Hal hal() { return {clock, servos, battery, link, storage}; }
  SimClock clock;
  SimServos servos;
  SimBattery battery;
  SimLink link;
  SimStorage storage;
};

}  // namespace foldcar
