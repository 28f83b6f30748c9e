// Fake of ESP-IDF 4.4: what the handler of crashes is given.
#pragma once

#include "../fake_esp32.h"

// Whether the SDK itself has ended the program.
inline bool g_panic_abort = false;

struct panic_info_t {
  const void* frame;
  bool pseudo_excause;  // a watchdog's time-out has made it, for example
};
