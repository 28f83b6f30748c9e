// MAVLink's log protocol: lists the stored logs of untethered trials and sends them in parts of 90 bytes.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal.h"
#include "outbox.h"

namespace foldcar {

class LogService {
 public:
  LogService(LogStorage& storage, Outbox& outbox) : storage_(storage), outbox_(outbox) {}

  // Each handles a message for this car.
  void list(const mavlink_log_request_list_t& request);
  void data(const mavlink_log_request_data_t& request);
  void erase();
  void end();

  // Erases a log, or continues a list or a log as far as the outbox has room: one thing with the storage in a call, because
  // each takes time.
  void run();

 private:
  void list_one();
  void send_entry(std::uint16_t id);
  void send_data();
  void erase_one();

  LogStorage& storage_;
  Outbox& outbox_;
  std::uint16_t next_entry_ = 0, last_entry_ = 0;    // of the list that is being sent, 0 for none
  std::uint16_t first_asked_ = 0, last_asked_ = 0;   // smallest and largest number that the host asked for
  std::uint16_t erased_to_ = 0;  // the newest log that is to be erased, 0 for none
  std::uint16_t log_ = 0;
  std::size_t offset_ = 0, end_ = 0;
};

}  // namespace foldcar
