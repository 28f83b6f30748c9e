// What the car tells of itself, as MAVLink packets.
#pragma once

#include <cstdint>

#include "application.h"
#include "hal.h"
#include "mavlink_packets.h"

namespace foldcar {

// How the loop around the application does; counted by whoever runs it.
struct LoopStatistics {
  std::uint32_t tick_count = 0;
  std::uint32_t missed_count = 0;
  std::uint32_t worst_us = 0;
  std::uint32_t last_us = 0;
};

struct LinkStatistics {
  std::uint32_t received_count = 0;
  std::uint32_t bad_count = 0;
  std::uint32_t unsent_count = 0;
};

// All that the messages are made of.
struct CarView {
  const Application& application;
  const Hal& hal;
  const LoopStatistics& loop;
  LinkStatistics link;
  const char* build;  // 16 hexadecimal digits
};

// The message of that id; false if the car does not send it, or cannot: without an IMU there is no attitude.
bool compose(std::uint32_t message_id, const CarView& car, mavlink_status_t& numbering, mavlink_message_t& message);

}  // namespace foldcar
