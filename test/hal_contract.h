// What hal.h promises, as Unity checks: run check_hal_contract over every implementation.
//
// The checks hold for any board, with or without an IMU and logs; they do not judge the values that a board measures.
// advance is called between readings of the clock and lets some of the board's time pass.
#pragma once

#include <unity.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <initializer_list>
#include <limits>
#include <string>

#include "hal.h"

namespace foldcar {

inline void check_servos_take_pulses(WheelServos& servos) {
  PulsesUs neutral_us;
  neutral_us.fill(1500.0f);
  PulsesUs mixed_us{};
  mixed_us[0] = 1000.0f;
  mixed_us[1] = 2000.0f;
  mixed_us[2] = 1545.25f;
  mixed_us[3] = kLongestOutputUs;
  TEST_ASSERT_TRUE_MESSAGE(servos.write_pulses(PulsesUs{}), "no pulses");
  TEST_ASSERT_TRUE_MESSAGE(servos.write_pulses(neutral_us), "a pulse on every output");
  TEST_ASSERT_TRUE_MESSAGE(servos.write_pulses(mixed_us), "shortest, longest, fractional, no pulse");
  for (const float wrong_us : {-1.0f, 3000.5f, 1e9f, std::numeric_limits<float>::quiet_NaN()}) {
    PulsesUs wrong{};
    wrong[7] = wrong_us;
    TEST_ASSERT_FALSE_MESSAGE(servos.write_pulses(wrong), "took a pulse outside its limits");
  }
  TEST_ASSERT_TRUE_MESSAGE(servos.write_pulses(PulsesUs{}), "off again");
}

inline void check_clock_goes_forward(const Clock& clock, const std::function<void()>& advance) {
  std::uint64_t last_us = clock.now_us();
  for (int i = 0; i < 20; ++i) {
    advance();
    const std::uint64_t now_us = clock.now_us();
    TEST_ASSERT_TRUE_MESSAGE(now_us > last_us, "the clock stands or went back");
    last_us = now_us;
  }
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

// Deletes what is stored.
inline void check_storage_gives_back_what_it_took(Storage& storage) {
  TEST_ASSERT_TRUE_MESSAGE(storage.present(), "stores nothing");
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
  TEST_ASSERT_TRUE(storage.load("LONGEST_NAME_15", value) && value == 3.0f);
  TEST_ASSERT_TRUE_MESSAGE(storage.clear(), "not cleared");
  TEST_ASSERT_FALSE_MESSAGE(storage.load("CONTRACT", value), "still there after clear");
}

// An IMU that is present answers with a finite sample; one that is not leaves the sample alone.
inline void check_imu_answers_if_present(Imu& imu) {
  ImuSample sample;
  sample.acceleration_m_s2 = sample.rate_rad_s = {1e9f, 1e9f, 1e9f};
  const bool answers = imu.read(sample);
  TEST_ASSERT_TRUE_MESSAGE(answers == imu.present(), "an IMU answers if, and only if, it is present");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float largest = std::fmax(std::fabs(sample.acceleration_m_s2[axis]), std::fabs(sample.rate_rad_s[axis]));
    TEST_ASSERT_TRUE_MESSAGE(answers ? largest < 1e4f : largest == 1e9f, "not m/s2 and rad/s, or not left alone");
  }
}

inline std::string content_of_log(LogStorage& logs, std::uint16_t id) {
  std::string content;
  std::uint8_t part[7];
  while (const std::size_t count = logs.read(id, content.size(), part, sizeof part)) {
    TEST_ASSERT_TRUE_MESSAGE(count <= sizeof part, "read more than asked");
    content.append(reinterpret_cast<const char*>(part), count);
  }
  TEST_ASSERT_EQUAL_UINT_MESSAGE(content.size(), logs.size(id), "a log's size is not that of its content");
  return content;
}

// Returns the log's number.
inline std::uint16_t store_log(LogStorage& logs, std::initializer_list<const char*> parts) {
  while (logs.prepare()) {
  }
  const std::uint16_t id = logs.create();
  TEST_ASSERT_TRUE_MESSAGE(id > 0, "not created");
  for (const char* part : parts) {
    TEST_ASSERT_TRUE(logs.append(reinterpret_cast<const std::uint8_t*>(part), std::strlen(part)));
  }
  TEST_ASSERT_TRUE_MESSAGE(logs.close(), "not closed");
  return id;
}

inline void check_range(LogStorage& logs, std::uint16_t oldest, std::uint16_t newest) {
  const LogRange found = logs.range();
  TEST_ASSERT_EQUAL_UINT(oldest, found.oldest);
  TEST_ASSERT_EQUAL_UINT(newest, found.newest);
}

// Needs a storage without logs and leaves it so.
inline void check_logs_give_back_what_they_took(LogStorage& logs) {
  const std::uint8_t bytes[3] = {1, 2, 3};
  std::uint8_t part[4] = {0, 0, 0, 0xA5};
  TEST_ASSERT_TRUE_MESSAGE(logs.range().is_empty(), "a log although none was created");
  TEST_ASSERT_FALSE_MESSAGE(logs.append(bytes, sizeof bytes), "appended although no log is open");
  TEST_ASSERT_FALSE_MESSAGE(logs.close(), "closed although no log is open");
  if (!logs.present()) {
    TEST_ASSERT_EQUAL_UINT_MESSAGE(0, logs.create(), "created although nothing can be stored");
    return;
  }
  const std::uint16_t first = store_log(logs, {"folded ", "car"}), second = store_log(logs, {"last"});
  const std::uint16_t third = store_log(logs, {});
  TEST_ASSERT_EQUAL_UINT_MESSAGE(next_log_number(first), second, "numbers do not go on");
  TEST_ASSERT_EQUAL_UINT(next_log_number(second), third);
  check_range(logs, first, third);
  TEST_ASSERT_TRUE(content_of_log(logs, first) == "folded car" && content_of_log(logs, third).empty());
  TEST_ASSERT_EQUAL_UINT(3, logs.read(first, 4, part, 3));
  TEST_ASSERT_EQUAL_MEMORY("ed ", part, 3);
  TEST_ASSERT_EQUAL_HEX8_MESSAGE(0xA5, part[3], "read wrote past its buffer");
  TEST_ASSERT_EQUAL_UINT_MESSAGE(0, logs.read(first, 10, part, 3), "read behind the end");
  const std::uint16_t missing = next_log_number(third);
  TEST_ASSERT_EQUAL_UINT_MESSAGE(0, logs.size(missing), "a size of a log that is not there");
  TEST_ASSERT_EQUAL_UINT_MESSAGE(0, logs.read(missing, 0, part, 3), "read a log that is not there");
  TEST_ASSERT_FALSE_MESSAGE(logs.remove(missing), "removed a log that is not there");

  TEST_ASSERT_EQUAL_UINT(10, logs.size(first));
  TEST_ASSERT_TRUE(logs.remove(first));
  TEST_ASSERT_EQUAL_UINT_MESSAGE(0, logs.size(first), "a removed log has a size");
  TEST_ASSERT_EQUAL_UINT_MESSAGE(0, logs.read(first, 0, part, 3), "a removed log can be read");
  check_range(logs, second, third);
  TEST_ASSERT_TRUE(logs.remove(third) && logs.remove(second));
  TEST_ASSERT_TRUE_MESSAGE(logs.range().is_empty(), "a log although all are removed");
}

// restart() is not called: what follows it is the board's own.
inline void check_board_names_its_reset(const Board& board) {
  const ResetReason reason = board.reset_reason();
  const bool has_crashed = reason >= ResetReason::kCrash && reason <= ResetReason::kOtherWatchdog;
  TEST_ASSERT_TRUE_MESSAGE(has_crashed || board.crash_report() == nullptr, "a report without a crash");
  TEST_ASSERT_TRUE_MESSAGE(reason <= ResetReason::kBrownOut, "not one of the reasons");
  TEST_ASSERT_TRUE_MESSAGE(reason == board.reset_reason(), "the reason has changed without a restart");
}

inline void check_hal_contract(const Hal& hal, const std::function<void()>& advance) {
  check_servos_take_pulses(hal.servos);
  check_clock_goes_forward(hal.clock, advance);
  check_battery_is_volts_or_nan(hal.battery);
  check_link_moves_no_more_than_asked(hal.link);
  check_storage_gives_back_what_it_took(hal.storage);
  check_imu_answers_if_present(hal.imu);
  check_logs_give_back_what_they_took(hal.logs);
  check_board_names_its_reset(hal.board);
}

}  // namespace foldcar
