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
  // id: of a log, or 0 for none.
  void add(std::uint16_t id) {
    if (id == 0) return;
    if (is_empty() || is_newer_log(oldest, id)) oldest = id;
    if (newest == 0 || is_newer_log(id, newest)) newest = id;
  }
};

}  // namespace foldcar
