// Fake of ESP-IDF 4.4: the walk through a task's stack, frame by frame.
#pragma once

#include "fake_esp32.h"

struct esp_backtrace_frame_t {
  std::uint32_t pc;
  std::uint32_t sp;
  std::uint32_t next_pc;
  const void* exc_frame;
};

// Of the caller; its own caller is the next one of the fake's stack, or none.
inline bool esp_backtrace_get_next_frame(esp_backtrace_frame_t* frame) {
  frame->pc = frame->next_pc;
  frame->next_pc = 0;
  if (!fake_esp32.return_addresses.empty()) {
    frame->next_pc = fake_esp32.return_addresses.front();
    fake_esp32.return_addresses.pop_front();
  }
  frame->sp += 32;
  return true;
}
