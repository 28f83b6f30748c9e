// The numbers of logs: 1 to 65535, then 1 again. A car keeps few logs, so their numbers are near each other, and of two
// numbers the newer one is the one that fewer steps lead to.
#pragma once

#include <cstdint>

namespace foldcar {

inline std::uint16_t next_log_number(std::uint16_t id) { return id == 0xFFFF ? 1 : static_cast<std::uint16_t>(id + 1); }

inline bool is_newer_log(std::uint16_t id, std::uint16_t than) {
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(id - than)) > 0;
}

// The oldest and the newest of some logs; both 0 without any.
struct LogRange {
  std::uint16_t oldest = 0, newest = 0;

  bool is_empty() const { return newest == 0; }
  // The number of logs, if none is missing between the oldest and the newest.
  std::uint16_t count() const {
    if (is_empty()) return 0;
    // Number 0 is left out where numbers begin anew.
    return static_cast<std::uint16_t>(newest - oldest + (newest < oldest ? 0 : 1));
  }
  // id: of a log, or 0 for none.
  void add(std::uint16_t id) {
    if (id == 0) return;
    const bool is_first = is_empty();
    if (is_first || is_newer_log(oldest, id)) oldest = id;
    if (is_first || is_newer_log(id, newest)) newest = id;
  }
};

}  // namespace foldcar
