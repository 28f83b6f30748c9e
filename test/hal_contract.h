// What every HAL promises, as Unity checks: run check_hal_contract over each implementation.
//
// advance is called between readings of the clock and lets some of the HAL's time pass (a simulated HAL is
// stepped, a real one waits). The contract asks nothing of the numbers a car measures.
#pragma once

#include <unity.h>

#include <cstdint>
#include <functional>
#include <initializer_list>

#include "hal.h"

namespace foldcar {

inline void check_servos_take_pulses(WheelServos& servos) {
  PulsesUs neutral_us;
  neutral_us.fill(1500.0f);
  PulsesUs mixed_us{};
  mixed_us[0] = 1000.0f;
  mixed_us[1] = 2000.0f;
  mixed_us[2] = 1545.25f;
  TEST_ASSERT_TRUE_MESSAGE(servos.write_pulses(PulsesUs{}), "no pulses");
  TEST_ASSERT_TRUE_MESSAGE(servos.write_pulses(neutral_us), "a pulse on every output");
  TEST_ASSERT_TRUE_MESSAGE(servos.write_pulses(mixed_us), "shortest, longest, fractional, no pulse");
  TEST_ASSERT_TRUE_MESSAGE(servos.write_pulses(PulsesUs{}), "off again");
}

inline void check_clock_goes_forward(const Clock& clock, const std::function<void()>& advance) {
  const std::uint64_t start_us = clock.now_us();
  std::uint64_t last_us = start_us;
  for (int i = 0; i < 20; ++i) {
    advance();
    const std::uint64_t now_us = clock.now_us();
    TEST_ASSERT_TRUE_MESSAGE(now_us >= last_us, "the clock went back");
    last_us = now_us;
  }
  TEST_ASSERT_TRUE_MESSAGE(last_us > start_us, "the clock stands although time has passed");
}

inline void check_battery_is_volts_or_nan(Battery& battery) {
  const float voltage_v = battery.voltage_v();
  const bool is_nan = voltage_v != voltage_v;  // Unity hides std::isnan behind a macro
  TEST_ASSERT_TRUE_MESSAGE(is_nan || (voltage_v >= 0.0f && voltage_v < 30.0f), "not volts");
}

inline void check_link_moves_no_more_than_asked(ByteLink& link) {
  std::uint8_t bytes[8] = {'f', 'o', 'l', 'd', 'c', 'a', 'r', '\n'};
  TEST_ASSERT_TRUE_MESSAGE(link.write(bytes, sizeof bytes) <= sizeof bytes, "wrote more than asked");
  TEST_ASSERT_EQUAL_UINT_MESSAGE(0, link.write(bytes, 0), "wrote something for nothing");
  bytes[4] = 0xA5;
  TEST_ASSERT_TRUE_MESSAGE(link.read(bytes, 4) <= 4, "read more than asked");
  TEST_ASSERT_EQUAL_HEX8_MESSAGE(0xA5, bytes[4], "read wrote past its buffer");
  TEST_ASSERT_EQUAL_UINT_MESSAGE(0, link.read(bytes, 0), "read something for nothing");
}

// Leaves the values CONTRACT and LONGEST_NAME_15 behind.
inline void check_storage_gives_back_what_it_took(Storage& storage) {
  float value = 7.0f;
  TEST_ASSERT_FALSE_MESSAGE(storage.load("NEVER_SAVED", value), "found what was never saved");
  TEST_ASSERT_TRUE_MESSAGE(value == 7.0f, "changed the value although there is none stored");
  for (const float saved : {1.5f, -0.111f, 25e6f, 0.0f}) {
    TEST_ASSERT_TRUE_MESSAGE(storage.save("CONTRACT", saved), "not saved");
    value = 7.0f;
    TEST_ASSERT_TRUE_MESSAGE(storage.load("CONTRACT", value), "not found");
    TEST_ASSERT_TRUE_MESSAGE(value == saved, "another value came back");
  }
  TEST_ASSERT_TRUE_MESSAGE(storage.save("LONGEST_NAME_15", 3.0f), "a name of 15 characters");
  TEST_ASSERT_TRUE(storage.load("LONGEST_NAME_15", value));
  TEST_ASSERT_TRUE(value == 3.0f);
}

inline void check_hal_contract(const Hal& hal, const std::function<void()>& advance) {
  check_servos_take_pulses(hal.servos);
  check_clock_goes_forward(hal.clock, advance);
  check_battery_is_volts_or_nan(hal.battery);
  check_link_moves_no_more_than_asked(hal.link);
  check_storage_gives_back_what_it_took(hal.storage);
}

}  // namespace foldcar
