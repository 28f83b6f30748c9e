// A trial's log between two threads, as between the board's two tasks: one records, the other stores.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <thread>

#include "log_writer.h"
#include "sim_hal.h"

namespace foldcar {

// Takes real time to append, and notes who writes.
struct ThreadLogs : SimLogs {
  std::thread::id writer;
  bool others_wrote = false;
  ThreadLogs() { fitted = true; }
  bool append(const std::uint8_t* data, std::size_t size) override {
    others_wrote = others_wrote || std::this_thread::get_id() != writer;
    std::this_thread::sleep_for(std::chrono::microseconds(300));
    // Byte by byte, as ThreadSanitizer does not see what the standard library's code reads.
    std::string copy;
    for (std::size_t i = 0; i < size; ++i) copy += static_cast<char>(data[i]);
    return SimLogs::append(reinterpret_cast<const std::uint8_t*>(copy.data()), size);
  }
};

// Records count logs, faster than they are stored, of records that are numbered and filled with their number.
// Returns what is wrong with what was stored; "" if nothing is.
inline std::string record_and_store_in_two_threads(int count, unsigned seed) {
  constexpr std::uint32_t kRecords = 10000;
  ThreadLogs logs;
  LogWriter writer(logs);
  std::atomic<bool> ends{false};
  std::thread worker([&] {
    while (!ends.load()) {
      if (!writer.work()) std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
  });
  logs.writer = worker.get_id();
  std::mt19937 random(seed);
  std::string problem;
  for (int log = 1; log <= count && problem.empty(); ++log) {
    std::string put;
    std::uint32_t lost = 0;
    while (!writer.is_idle()) std::this_thread::yield();
    if (!writer.begin()) problem = "a log that was closed is not free";
    for (std::uint32_t number = 0; number < kRecords; ++number) {
      std::uint8_t record[64];
      const std::size_t size = 8 + random() % 56;
      std::memset(record, static_cast<int>(number & 0xFF), 64);
      std::memcpy(record, &number, sizeof number);
      if (writer.put(record, size, 128)) {
        put.append(record, record + size);
      } else {
        writer.lose(size);
        lost += static_cast<std::uint32_t>(size);
      }
    }
    writer.finish();
    while (!writer.is_idle()) std::this_thread::yield();
    const LogStatus status = writer.status();
    std::string stored(logs.size(static_cast<std::uint16_t>(log)), '\0');
    logs.read(static_cast<std::uint16_t>(log), 0, reinterpret_cast<std::uint8_t*>(stored.data()), stored.size());
    if (stored != put) problem = "stored is not what was recorded";
    if (lost == 0) problem = "all found room";
    if (status.lost_bytes != lost) problem = "another count of lost bytes";
    if (status.state != (lost == 0 ? LogState::kStored : LogState::kIncomplete)) problem = "another state";
  }
  ends.store(true);
  worker.join();
  return logs.others_wrote ? "the thread that records has written" : problem;
}

}  // namespace foldcar
