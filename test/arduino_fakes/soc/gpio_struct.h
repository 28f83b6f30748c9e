// Fake of ESP-IDF 4.4: the registers that set and clear the levels of pins 0 to 31.
#pragma once

#include "fake_esp32.h"

template <int kLevel>
struct FakeGpioRegister {
  void operator=(std::uint32_t pins) {
    for (int pin = 0; pin < 32; ++pin) {
      if ((pins >> pin & 1u) != 0) write_fake_pin(pin, kLevel);
    }
  }
};

struct FakeGpio {
  FakeGpioRegister<1> out_w1ts;
  FakeGpioRegister<0> out_w1tc;
};

inline FakeGpio GPIO;
