// A HAL for unit tests: time and voltage are set by the test, pulses and bytes are recorded.
//
// It holds no behaviour that could be wrong by itself; the whole loop is tested over the simulator's HAL.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "hal.h"

namespace foldcar {

struct RecordingClock : Clock {
  std::uint64_t time_us = 0;
  std::uint64_t now_us() const override { return time_us; }
};

struct RecordingServos : WheelServos {
  bool answers = true;
  std::vector<PulsesUs> writes;
  bool write_pulses(const PulsesUs& pulses_us) override {
    writes.push_back(pulses_us);
    return answers;
  }
};

struct RecordingBattery : Battery {
  float volts = 4.0f;
  float voltage_v() override { return volts; }
};

struct RecordingLink : ByteLink {
  std::string incoming;
  std::string outgoing;
  std::size_t room = 1000;  // bytes taken by each write at most
  std::size_t read(std::uint8_t* data, std::size_t size) override {
    const std::size_t count = std::min(size, incoming.size());
    std::copy_n(incoming.begin(), count, data);
    incoming.erase(0, count);
    return count;
  }
  std::size_t write(const std::uint8_t* data, std::size_t size) override {
    const std::size_t count = std::min(size, room);
    outgoing.append(reinterpret_cast<const char*>(data), count);
    return count;
  }
};

struct RecordingStorage : Storage {
  std::map<std::string, float> values;
  bool accepts = true;
  bool load(const char* name, float& value) override {
    const auto found = values.find(name);
    if (found == values.end()) return false;
    value = found->second;
    return true;
  }
  bool save(const char* name, float value) override {
    if (accepts) values[name] = value;
    return accepts;
  }
};

struct RecordingHal {
  RecordingClock clock;
  RecordingServos servos;
  RecordingBattery battery;
  RecordingLink link;
  RecordingStorage storage;
  Hal hal() { return {clock, servos, battery, link, storage}; }
};

}  // namespace foldcar
