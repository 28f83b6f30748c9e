// Fake of ESP-IDF 4.4: the address of the call, of its return address, whose two highest bits are no address.
#pragma once

#include <cstdint>

inline std::uint32_t esp_cpu_process_stack_pc(std::uint32_t pc) {
  if ((pc & 0x80000000u) != 0) pc = (pc & 0x3FFFFFFFu) | 0x40000000u;
  return pc - 3;
}
