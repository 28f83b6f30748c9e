// The simulated HAL for unit tests, with servos that keep every write and a link of text whose capacity the test sets.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "sim_hal.h"

namespace foldcar {

// Every write in order, refused ones included.
struct RecordingServos : SimServos {
  std::vector<PulsesUs> writes;
  bool write_pulses(const PulsesUs& pulses_us) override {
    writes.push_back(pulses_us);
    return SimServos::write_pulses(pulses_us);
  }
};

// The firmware reads incoming and appends to outgoing at most room bytes in each write.
struct RecordingLink : ByteLink {
  std::string incoming;
  std::string outgoing;
  std::size_t room = 1000;
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

struct RecordingHal : BasicSimHal<RecordingServos, RecordingLink> {
  RecordingHal() { logs.fitted = true; }
  // An IMU on a car that stands level.
  void fit_imu() {
    imu.fitted = true;
    imu.now.acceleration_m_s2 = {0.0f, 0.0f, 9.81f};
  }
};

}  // namespace foldcar
