// Bytes on the car's port, in pieces: the first two bytes of a piece are its size and the time until the next. Whatever
// comes, pulses are none or within what servos take, and a car that is left alone is disarmed and its outputs are off.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "../recording_hal.h"
#include "firmware.h"

namespace {

// The longest that parameters let a trial last, or a car stay armed.
constexpr std::uint64_t kLongest_us = 3600000000 + 1000000;

void check(const foldcar::PulsesUs& pulses_us) {
  for (const float pulse_us : pulses_us) {
    if (pulse_us != 0 && !(pulse_us >= 500 && pulse_us <= 2500)) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  foldcar::RecordingHal board;
  board.fit_imu();
  board.link.room = 100000;
  foldcar::Firmware firmware(board.hal(), "0123456789abcdef");
  firmware.begin({});
  for (std::size_t at = 0; at + 2 < size;) {
    const std::size_t count = std::min<std::size_t>(data[at], size - at - 2);
    board.link.incoming.assign(reinterpret_cast<const char*>(data) + at + 2, count);
    board.clock.time_us += 1 + std::uint64_t{data[at + 1]} * 200;
    at += 2 + count;
    firmware.poll();
    firmware.store_log();
    for (const foldcar::PulsesUs& pulses_us : board.servos.writes) check(pulses_us);
    board.servos.writes.clear();
    board.link.outgoing.clear();
  }
  board.link.incoming.clear();
  const auto wait = [&](std::uint64_t period_us) {
    board.servos.writes.clear();
    board.clock.time_us += period_us;
    firmware.poll();
    board.link.outgoing.clear();
  };
  // A packet behind a false start of one is handled 0.1 s later, and it may arm the car.
  for (int tick = 0; tick < 50; ++tick) wait(20000);
  const std::uint64_t end_us = board.clock.time_us + kLongest_us;
  while (firmware.application().is_armed() && board.clock.time_us < end_us) wait(400000);
  wait(20000);
  if (firmware.application().is_armed()) std::abort();
  if (board.servos.writes.empty() || board.servos.writes.back() != foldcar::PulsesUs{}) std::abort();
  return 0;
}
