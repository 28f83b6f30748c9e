// Logs of trials in the partition "logs" of the ESP32's flash (firmware/partitions.csv).
//
// The partition has a slot for each log that is kept, and one for the next. A slot is erased before its log is created, so
// that a log is only programmed, which takes at most 3 ms for a page (erasing takes up to 400 ms for a block; W25Q32JV's data
// sheet). The first page of a slot has the log's number and a checksum, each further page: number of bytes, bytes, checksum.
//
// The number is programmed as soon as the slot is erased, while wheels stand: when they start, servos draw so much that the
// supply may fail. A slot whose first page was torn by a reset, or that has no further page, has no log.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <esp_partition.h>

#include "hal.h"

namespace foldcar {

// Until begin() has succeeded no log can be stored.
class FlashLogs : public LogStorage {
 public:
  // Finds the partition and the logs in it. Returns false without a partition of sufficient size.
  bool begin();
  // From now on no log can be stored.
  void give_up() { partition_ = nullptr; }

  bool present() const override { return partition_ != nullptr; }
  bool prepare() override;
  std::uint16_t create() override;
  bool append(const std::uint8_t* data, std::size_t size) override;
  bool close() override;
  std::size_t size(std::uint16_t id) override;
  std::size_t read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) override;
  bool remove(std::uint16_t id) override;
  LogRange range() const override;

 private:
  static constexpr std::size_t kSlots = kLogsKept + 1;
  static constexpr std::size_t kNone = kSlots;  // no slot
  static constexpr std::size_t kPage = 256, kBlock = 4096;
  // Of a page: one byte for their number, then the bytes of the log, then two of a checksum.
  static constexpr std::size_t kContent = kPage - 3;
  static constexpr std::size_t kSlotSize = 64 * kBlock;
  static_assert((kSlotSize / kPage - 1) * kContent >= kLogSize, "a slot has room for a log");

  using Page = std::array<std::uint8_t, kPage>;

  // The slot of a log; kNone if there is no such log.
  std::size_t slot_of(std::uint16_t id) const;
  bool read_page(std::size_t slot, std::size_t page, Page& content) const;
  std::uint16_t read_number(std::size_t slot) const;
  bool program_number(std::size_t slot, std::uint16_t id);
  bool program_page();
  std::size_t programmed_pages(std::size_t slot) const;
  // Whether a page has been programmed as a whole.
  static bool is_whole(const Page& page);
  // Whether nothing needs to be erased in a block.
  bool block_is_blank(std::size_t slot, std::size_t block) const;

  const esp_partition_t* partition_ = nullptr;
  std::array<std::uint16_t, kSlots> ids_{};  // of the log in each slot, 0 in an empty one
  std::size_t prepared_ = kNone;             // the slot that is erased and has a number
  std::uint16_t prepared_id_ = 0;            // this number
  std::size_t erasing_ = kNone, erased_blocks_ = 0;  // the slot that is being erased
  std::size_t open_ = kNone;                 // the slot of the open log
  std::size_t page_number_ = 0;              // of the page that is filled next
  std::size_t page_bytes_ = 0;               // bytes of the log in it
  Page page_;
  std::uint16_t measured_id_ = 0;            // the log whose size was asked for last
  std::size_t measured_size_ = 0;
};

}  // namespace foldcar
