// Sends each message at its interval.
//
// Input: the time. Output: packets in the outbox, each at the first call after it is due. A late call does not delay the
// packets after it.
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

  // now_us: time since start (µs).
  void run(std::uint64_t now_us, const CarView& car, Outbox& outbox);

  // As MAV_CMD_SET_MESSAGE_INTERVAL: interval_us in µs, -1 for never, 0 for the default. Returns false if the car does not
  // send the message or the interval is not from 20 ms to 2000 s.
  bool set_interval(std::uint32_t message_id, float interval_us, std::uint64_t now_us);
  // Interval in µs; -1 if the message is sent on request only, 0 if the car does not send it.
  std::int32_t interval_us(std::uint32_t message_id) const;

 private:
  struct Entry {
    std::int32_t interval_us = -1;
    std::uint64_t next_us = 0;
  };

  std::array<Entry, kMaxMessageCount> entries_{};
};

}  // namespace foldcar
