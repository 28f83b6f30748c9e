#include "telemetry.h"

namespace foldcar {
namespace {

constexpr float kLongestIntervalUs = 2e9f;

}  // namespace

Telemetry::Telemetry() {
  for (std::size_t i = 0; i < message_count(); ++i) entries_[i].interval_us = message_info(i).interval_us;
}

// Sends every message whose time has come.
void Telemetry::run(std::uint64_t now_us, const CarView& car, Outbox& outbox) {
  for (std::size_t i = 0; i < message_count(); ++i) {
    Entry& entry = entries_[i];
    if (entry.interval_us < 0 || now_us < entry.next_us) continue;
    const auto interval_us = static_cast<std::uint64_t>(entry.interval_us);
    entry.next_us += interval_us;
    if (entry.next_us <= now_us) entry.next_us = now_us + interval_us;
    mavlink_message_t message;
    if (compose(message_info(i).id, car, outbox.numbers(), message)) outbox.send(message, Priority::kTelemetry);
  }
}

// Sets a message's interval (µs): -1 stops it, 0 restores the default. Returns false if message or interval is not
// allowed.
bool Telemetry::set_interval(std::uint32_t message_id, float interval_us, std::uint64_t now_us) {
  const std::size_t index = find_message(message_id);
  if (index == message_count()) return false;
  Entry& entry = entries_[index];
  if (interval_us == -1.0f) {
    entry.interval_us = -1;
  } else if (interval_us == 0.0f) {
    entry = {message_info(index).interval_us, now_us};
  } else {
    if (!(interval_us >= static_cast<float>(kShortestIntervalUs) && interval_us <= kLongestIntervalUs)) return false;
    entry = {static_cast<std::int32_t>(interval_us), now_us};
  }
  return true;
}

std::int32_t Telemetry::interval_us(std::uint32_t message_id) const {
  const std::size_t index = find_message(message_id);
  return index == message_count() ? 0 : entries_[index].interval_us;
}

}  // namespace foldcar
