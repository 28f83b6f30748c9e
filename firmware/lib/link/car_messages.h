// The messages that the car sends about itself: their content and their default intervals. A new one is a function and a
// row of the table in car_messages.cpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "application.h"
#include "hal.h"
#include "log_writer.h"
#include "outbox.h"

namespace foldcar {

// Counts and durations (µs) of the firmware's 50 Hz ticks.
struct LoopStatistics {
  std::uint32_t tick_count = 0;
  std::uint32_t missed_count = 0;
  std::uint32_t worst_us = 0;
  std::uint32_t last_us = 0;
};

// Packets received, bytes received that belong to no packet, packets not sent for want of room.
struct LinkStatistics {
  std::uint32_t received_count = 0;
  std::uint32_t bad_count = 0;
  std::uint32_t unsent_count = 0;
};

// Everything that the messages are made from.
struct CarView {
  const Application& application;
  const Hal& hal;
  const LoopStatistics& loop;
  LinkStatistics link;
  LogStatus log;
  const char* build;  // 16 hexadecimal digits
};

struct MessageInfo {
  std::uint32_t id;
  std::int32_t interval_us;  // by default; -1 if the message is sent on request only
};

// Upper bound of message_count(), for arrays with an entry for each message.
constexpr std::size_t kMaxMessageCount = 16;

std::size_t message_count();
// index: 0 to message_count() - 1.
const MessageInfo& message_info(std::size_t index);
// The index of a message; message_count() if the car does not send it.
std::size_t find_message(std::uint32_t message_id);

// Packs the message with that id. Returns false if the car does not send it or has not got its content: without an IMU
// there is no attitude.
bool compose(std::uint32_t message_id, const CarView& car, PacketNumbers& numbers, mavlink_message_t& message);

}  // namespace foldcar
