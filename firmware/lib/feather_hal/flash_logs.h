// Logs of trials as files of the ESP32's flash file system (LittleFS): /log_00001 to /log_65535.
#pragma once

#include <cstddef>
#include <cstdint>

#include <FS.h>

#include "hal.h"

namespace foldcar {

// Until begin() has succeeded no log can be stored.
class FlashLogs : public LogStorage {
 public:
  // Mounts the file system. Returns false if there is none that mounts; it is not formatted, as a design may be in it.
  bool begin();
  // From now on no log can be stored.
  void give_up();

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
  void close_reading();
  void find_range();

  bool mounted_ = false;
  std::uint16_t first_ = 0, last_ = 0;  // smallest and largest number, 0 if there is no log
  fs::File written_;
  std::size_t written_size_ = 0;  // bytes
  std::size_t flushed_size_ = 0;  // of these, in flash for certain
  fs::File read_;
  std::uint16_t read_id_ = 0;  // number of the log that read_ refers to, 0 for none
  std::size_t read_at_ = 0;    // how far (bytes) it is read
};

}  // namespace foldcar
