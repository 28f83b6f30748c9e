// A HAL for unit tests: time and voltage are set by the test, pulses and bytes are recorded.
//
// It holds no behaviour that could be wrong by itself; the whole loop is tested over the simulator's HAL.
#pragma once

#include <algorithm>
#include <cstddef>
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
  bool clear() override {
    if (accepts) values.clear();
    return accepts;
  }
};

struct RecordingImu : Imu {
  bool fitted = false;
  bool answers = true;
  ImuSample now;
  bool present() const override { return fitted; }
  bool read(ImuSample& sample) override {
    if (fitted && answers) sample = now;
    return fitted && answers;
  }
};

struct RecordingLogs : LogStorage {
  std::map<std::uint16_t, std::string> logs;
  std::uint16_t open = 0;
  bool accepts = true;
  bool present() const override { return true; }
  bool create(std::uint16_t id) override {
    open = id;
    if (accepts) logs[id].clear();
    return accepts;
  }
  bool append(const std::uint8_t* data, std::size_t size) override {
    if (accepts) logs[open].append(reinterpret_cast<const char*>(data), size);
    return accepts;
  }
  bool close() override {
    open = 0;
    return accepts;
  }
  std::size_t size(std::uint16_t id) override { return logs.count(id) == 0 ? 0 : logs[id].size(); }
  std::size_t read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) override {
    if (logs.count(id) == 0 || offset >= logs[id].size()) return 0;
    return logs[id].copy(reinterpret_cast<char*>(data), size, offset);
  }
  bool remove(std::uint16_t id) override { return logs.erase(id) > 0; }
  bool range(std::uint16_t& first, std::uint16_t& last) override {
    if (logs.empty()) return false;
    first = logs.begin()->first;
    last = logs.rbegin()->first;
    return true;
  }
};

struct RecordingBoard : Board {
  ResetReason reason = ResetReason::kPowerOn;
  int restart_count = 0;
  ResetReason reset_reason() const override { return reason; }
  void restart() override { ++restart_count; }
};

struct RecordingHal {
  RecordingClock clock;
  RecordingServos servos;
  RecordingBattery battery;
  RecordingLink link;
  RecordingStorage storage;
  RecordingImu imu;
  RecordingLogs logs;
  RecordingBoard board;
  Hal hal() { return {clock, servos, battery, link, storage, imu, logs, board}; }
};

}  // namespace foldcar
