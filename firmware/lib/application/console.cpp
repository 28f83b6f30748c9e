#include "console.h"

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>

namespace foldcar {
namespace {

constexpr std::uint64_t kStatusPeriodUs = 1000000;

// Slow and short enough for a table top.
constexpr TrialRequest kGoTrial{0.1f, 0.0f, 2.0f, true};

}  // namespace

void Console::poll(std::uint64_t now_us) {
  std::array<std::uint8_t, 16> commands;
  const std::size_t count = link_.read(commands.data(), commands.size());
  for (std::size_t i = 0; i < count; ++i) obey(static_cast<char>(commands[i]));

  const bool sent = sent_size_ == line_size_;
  if (sent && now_us >= next_status_us_) {
    next_status_us_ = now_us + kStatusPeriodUs;
    compose_status_line();
  }
  send();
}

void Console::obey(char command) {
  switch (command) {
    case 'a': last_answer_ = application_.arm(); break;
    case 'd': last_answer_ = application_.disarm(); break;
    case 'g': last_answer_ = application_.start(kGoTrial); break;
    case 's': last_answer_ = application_.stop(); break;
    case 'c': last_answer_ = application_.acknowledge(); break;
    default: break;  // line ends of terminals, noise
  }
}

// Whole milliseconds and millivolts: printing floats takes memory from the heap on the board.
void Console::compose_status_line() {
  const Status status = application_.status();
  const auto trial_ms = static_cast<std::uint32_t>(status.trial_elapsed_us / 1000);
  const std::int32_t battery_mv =
      std::isnan(status.battery_v) ? -1 : static_cast<std::int32_t>(1000.0f * status.battery_v + 0.5f);
  const int size = std::snprintf(
      line_.data(), line_.size(),
      "%s, fault: %s, trial %" PRIu32 " ms, battery %" PRId32 " mV, last command: %s\r\n",
      text(status.state), text(status.fault), trial_ms, battery_mv, text(last_answer_));
  line_size_ = std::min<std::size_t>(static_cast<std::size_t>(std::max(size, 0)), line_.size() - 1);
  sent_size_ = 0;
}

void Console::send() {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(line_.data());
  sent_size_ += link_.write(bytes + sent_size_, line_size_ - sent_size_);
}

}  // namespace foldcar
