#include "led.h"

#include <cstring>

namespace foldcar {
namespace {

constexpr std::uint64_t kStepUs = 100000;  // each character of a pattern, which is repeated

bool is_in_fault(State state, LogState) { return state == State::kFault; }
bool counts(State state, LogState) { return state == State::kCounting; }
bool drives(State state, LogState) {
  return state == State::kRunning || state == State::kManual || state == State::kTesting;
}
bool is_armed(State state, LogState) { return state == State::kArmed; }
bool lacks_log(State, LogState log) { return log == LogState::kOpen || log == LogState::kIncomplete; }
bool stands(State, LogState) { return true; }

struct Row {
  bool (*applies)(State, LogState);
  const char* pattern;
};

// docs/firmware.md has this table too.
constexpr Row kRows[] = {
    {is_in_fault, "#.#.#......."},
    {counts, "#."},
    {drives, "#"},
    {is_armed, "#####....."},
    {lacks_log, "#.#........."},
    {stands, "."},
};

}  // namespace

// Whether the LED is on now, by the pattern of the first row that applies: one character per kStepUs, # on.
bool led_is_on(State state, LogState log, std::uint64_t now_us) {
  for (const Row& row : kRows) {
    if (row.applies(state, log)) return row.pattern[now_us / kStepUs % std::strlen(row.pattern)] == '#';
  }
  return false;
}

}  // namespace foldcar
