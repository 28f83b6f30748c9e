// A model of the board's flash for tests: writing takes its time, and there may be too little room.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

#include "sim_hal.h"

namespace foldcar {

// Each write of a log takes 65 to 100 ms, one in ten 0.6 s, as measured on LittleFS: it copies a file's last block at every
// flush. Reading takes 10 ms, an assumption. Whoever writes or reads loses that time on the clock.
struct SlowLogs : SimLogs {
  explicit SlowLogs(SimClock& clock) : clock_(clock) { fitted = true; }

  double slowness = 1.0;             // factor on all times
  std::size_t capacity = 1441792;    // bytes
  int write_count = 0;

  bool create(std::uint16_t id) override { return write() && SimLogs::create(id); }
  bool append(const std::uint8_t* data, std::size_t size) override {
    std::size_t used = size;
    for (const auto& [id, log] : logs) used += log.size();
    return write() && used <= capacity && SimLogs::append(data, size);
  }
  bool close() override { return write() && SimLogs::close(); }
  bool remove(std::uint16_t id) override { return write() && SimLogs::remove(id); }
  std::size_t size(std::uint16_t id) override {
    read_flash();
    return SimLogs::size(id);
  }
  std::size_t read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) override {
    read_flash();
    return SimLogs::read(id, offset, data, size);
  }

 private:
  void read_flash() { clock_.time_us += static_cast<std::uint64_t>(10000.0 * slowness); }
  bool write() {
    const double ms = ++write_count % 10 == 0 ? 600.0 : std::uniform_real_distribution<double>(65.0, 100.0)(random_);
    clock_.time_us += static_cast<std::uint64_t>(1000.0 * slowness * ms);
    return true;
  }

  SimClock& clock_;
  std::mt19937 random_{1};
};

// Saving a number takes 5 ms, one in ten 100 ms.
struct SlowStorage : SimStorage {
  explicit SlowStorage(SimClock& clock) : clock_(clock) {}

  double slowness = 1.0;  // factor on all times
  int save_count = 0;

  bool save(const char* name, float value) override {
    const double ms = ++save_count % 10 == 0 ? 100.0 : 5.0;
    clock_.time_us += static_cast<std::uint64_t>(1000.0 * slowness * ms);
    return SimStorage::save(name, value);
  }

 private:
  SimClock& clock_;
};

}  // namespace foldcar
