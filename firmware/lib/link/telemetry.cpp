#include "telemetry.h"

#include <cmath>
#include <iterator>

namespace foldcar {
namespace {

struct Default {
  std::uint32_t message_id;
  std::int32_t interval_us;
};

// docs/link.md holds this table in words. The state comes before the pulses of the same moment.
constexpr Default kDefaults[] = {
    {MAVLINK_MSG_ID_HEARTBEAT, 1000000},   {MAVLINK_MSG_ID_FOLDCAR_TRIAL, 100000},
    {MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, 20000}, {MAVLINK_MSG_ID_SYS_STATUS, 500000},
    {MAVLINK_MSG_ID_ATTITUDE, 100000},     {MAVLINK_MSG_ID_SCALED_IMU, 100000},
    {MAVLINK_MSG_ID_SYSTEM_TIME, 1000000}, {MAVLINK_MSG_ID_FOLDCAR_LOOP, 1000000},
    {MAVLINK_MSG_ID_FOLDCAR_DESIGN, -1},   {MAVLINK_MSG_ID_AUTOPILOT_VERSION, -1},
};

constexpr float kLongestIntervalUs = 2e9f;

std::size_t index_of(std::uint32_t message_id) {
  std::size_t index = 0;
  while (index < std::size(kDefaults) && kDefaults[index].message_id != message_id) ++index;
  return index;
}

}  // namespace

Telemetry::Telemetry() {
  static_assert(std::size(kDefaults) == kMessageCount, "an entry for each message");
  for (std::size_t i = 0; i < kMessageCount; ++i) entries_[i].interval_us = kDefaults[i].interval_us;
}

void Telemetry::run(std::uint64_t now_us, const CarView& car, Outbox& outbox) {
  for (std::size_t i = 0; i < kMessageCount; ++i) {
    Entry& entry = entries_[i];
    if (entry.interval_us < 0 || now_us < entry.next_us) continue;
    const auto interval_us = static_cast<std::uint64_t>(entry.interval_us);
    entry.next_us += interval_us;
    if (entry.next_us <= now_us) entry.next_us = now_us + interval_us;
    mavlink_message_t message;
    if (compose(kDefaults[i].message_id, car, outbox.numbering(), message)) outbox.send(message, Priority::kTelemetry);
  }
}

bool Telemetry::set_interval(std::uint32_t message_id, float interval_us, std::uint64_t now_us) {
  const std::size_t index = index_of(message_id);
  if (index == kMessageCount) return false;
  Entry& entry = entries_[index];
  if (interval_us == -1.0f) {
    entry.interval_us = -1;
  } else if (interval_us == 0.0f) {
    entry = {kDefaults[index].interval_us, now_us};
  } else {
    if (!(interval_us >= static_cast<float>(kShortestIntervalUs) && interval_us <= kLongestIntervalUs)) return false;
    entry = {static_cast<std::int32_t>(interval_us), now_us};
  }
  return true;
}

std::int32_t Telemetry::interval_us(std::uint32_t message_id) const {
  const std::size_t index = index_of(message_id);
  return index == kMessageCount ? 0 : entries_[index].interval_us;
}

}  // namespace foldcar
