// The file system in the ESP32's flash (LittleFS): the car's design, and the logs of its untethered trials.
#pragma once

#include <cstddef>
#include <cstdint>

#include <FS.h>

#include "car_design.h"
#include "hal.h"

namespace foldcar {

// Logs are files named by their numbers. Without begin(), or after a failed one, there are none.
class FlashLogs : public LogStorage {
 public:
  // Mounts the file system; formats it where there is none, which takes seconds.
  bool begin();

  bool present() const override { return mounted_; }
  bool create(std::uint16_t id) override;
  bool append(const std::uint8_t* data, std::size_t size) override;
  bool close() override;
  std::size_t size(std::uint16_t id) override;
  std::size_t read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) override;
  bool remove(std::uint16_t id) override;
  bool range(std::uint16_t& first, std::uint16_t& last) override;

 private:
  bool open_to_read(std::uint16_t id);
  void find_range();

  bool mounted_ = false;
  std::uint16_t first_ = 0, last_ = 0;  // 0: there is none
  fs::File written_;
  fs::File read_;
  std::uint16_t read_id_ = 0;
};

// /car.json, to be called after FlashLogs::begin(). Takes memory from the heap, all of which it gives back.
DesignResult read_car_json();

}  // namespace foldcar
