// Which message goes out how often.
//
// Input: the time. Output: packets in the outbox, each at the first call after its time; a late call delays no
// later one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "car_messages.h"
#include "outbox.h"

namespace foldcar {

constexpr std::int32_t kShortestIntervalUs = static_cast<std::int32_t>(kTickUs);

class Telemetry {
 public:
  Telemetry();

  void run(std::uint64_t now_us, const CarView& car, Outbox& outbox);

  // As MAV_CMD_SET_MESSAGE_INTERVAL: -1 never, 0 the default. False if the car has no such message or the interval
  // is too short.
  bool set_interval(std::uint32_t message_id, float interval_us, std::uint64_t now_us);
  // -1 if it is not sent by itself, 0 if the car has no such message.
  std::int32_t interval_us(std::uint32_t message_id) const;

 private:
  static constexpr std::size_t kMessageCount = 10;
  struct Entry {
    std::int32_t interval_us = -1;
    std::uint64_t next_us = 0;
  };

  std::array<Entry, kMessageCount> entries_{};
};

}  // namespace foldcar
