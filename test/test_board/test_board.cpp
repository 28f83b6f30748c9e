// Clock, battery, serial port, reset and watchdog of the ESP32.
#include "../suite.h"

#include <esp_log.h>
#include <esp_system.h>

#include <cmath>
#include <cstring>

#include "feather_bench.h"

using namespace foldcar;

TEST(the_clock_counts_on_where_32_bits_end) {
  FeatherBench bench;
  fake_esp32.time_us = 4294967295;  // 71.6 minutes
  TEST_ASSERT_EQUAL_UINT64(4294967295u, bench.hal.clock.now_us());
  fake_esp32.time_us += 1;
  TEST_ASSERT_EQUAL_UINT64(4294967296u, bench.hal.clock.now_us());
}

TEST(the_battery_has_twice_the_voltage_of_its_pin) {
  FeatherBench bench;
  TEST_ASSERT_EQUAL_FLOAT(3.8f, bench.hal.battery.voltage_v());
  fake_esp32.pin_mv[35] = 1250;
  TEST_ASSERT_EQUAL_FLOAT(2.5f, bench.hal.battery.voltage_v());
}

// The converter gives 142 mV for a pin without voltage, and the core 0 if the conversion fails.
TEST(a_broken_divider_is_no_battery) {
  FeatherBench bench;
  for (const std::uint32_t pin_mv : {0u, 142u, 499u}) {
    fake_esp32.pin_mv[35] = pin_mv;
    TEST_ASSERT_FLOAT_IS_NAN(bench.hal.battery.voltage_v());
  }
}

TEST(the_serial_port_has_room_for_a_burst_of_packets) {
  BegunBench bench;
  TEST_ASSERT_EQUAL_UINT(115200, fake_esp32.uart.baud);
  TEST_ASSERT_EQUAL_UINT(1024, fake_esp32.uart.receive_capacity);
  TEST_ASSERT_EQUAL_INT_MESSAGE(ESP_LOG_NONE, fake_esp32.log_level, "the SDK's texts break packets");
}

TEST(bytes_that_have_arrived_are_read_in_order) {
  BegunBench bench;
  for (const std::uint8_t byte : {0x00, 0xFD, 0xFF, 0x0A, 0x7F}) fake_esp32.uart.receive_buffer.push_back(byte);
  std::uint8_t bytes[4] = {};
  TEST_ASSERT_EQUAL_UINT(3, bench.hal.link.read(bytes, 3));
  const std::uint8_t expected[] = {0x00, 0xFD, 0xFF};
  TEST_ASSERT_EQUAL_MEMORY(expected, bytes, 3);
  TEST_ASSERT_EQUAL_UINT(2, bench.hal.link.read(bytes, 4));
  TEST_ASSERT_EQUAL_HEX8(0x7F, bytes[1]);
  TEST_ASSERT_EQUAL_UINT(0, bench.hal.link.read(bytes, 4));
}

// The UART's FIFO takes 128 bytes; more would have to wait for 87 µs each.
TEST(a_write_takes_what_fits_and_never_waits) {
  BegunBench bench;
  std::uint8_t bytes[300];
  std::memset(bytes, 0x55, sizeof bytes);
  TEST_ASSERT_EQUAL_UINT(128, bench.hal.link.write(bytes, sizeof bytes));
  TEST_ASSERT_EQUAL_UINT(0, bench.hal.link.write(bytes, sizeof bytes));
  fake_esp32.uart.transmit_fifo = 100;
  TEST_ASSERT_EQUAL_UINT(28, bench.hal.link.write(bytes, sizeof bytes));
  TEST_ASSERT_EQUAL_UINT(156, fake_esp32.uart.transmitted.size());
  TEST_ASSERT_FALSE(fake_esp32.uart.write_waited);
}

TEST(the_board_is_no_simulator) {
  FeatherBench bench;
  TEST_ASSERT_FALSE(bench.hal.board.is_simulated());
}

TEST(the_reset_reason_is_the_chips) {
  FeatherBench bench;
  using R = ResetReason;
  const std::pair<esp_reset_reason_t, R> kReasons[] = {
      {ESP_RST_UNKNOWN, R::kUnknown}, {ESP_RST_POWERON, R::kPowerOn}, {ESP_RST_SW, R::kSoftware},
      {ESP_RST_PANIC, R::kCrash}, {ESP_RST_INT_WDT, R::kInterruptWatchdog}, {ESP_RST_TASK_WDT, R::kTaskWatchdog},
      {ESP_RST_WDT, R::kOtherWatchdog}, {ESP_RST_BROWNOUT, R::kBrownOut}, {ESP_RST_SDIO, R::kUnknown}};
  for (const auto& [chips, expected] : kReasons) {
    fake_esp32.reset_reason = chips;
    TEST_ASSERT_TRUE(bench.hal.board.reset_reason() == expected);
  }
}

TEST(a_restart_comes_after_the_last_byte_was_sent) {
  BegunBench bench;
  const std::uint8_t byte = 1;
  bench.hal.link.write(&byte, 1);
  bool has_restarted = false;
  try {
    bench.hal.board.restart();
  } catch (const FakeRestart&) {
    has_restarted = true;
  }
  TEST_ASSERT_TRUE(has_restarted);
  TEST_ASSERT_TRUE(fake_esp32.uart.flushed);
}

TEST(the_watchdog_restarts_a_loop_that_stands_for_a_second) {
  FeatherBench bench;
  bench.hal.board.start_watchdog();
  TEST_ASSERT_EQUAL_UINT32(1, fake_esp32.watchdog_s);
  TEST_ASSERT_TRUE(fake_esp32.watchdog_panics);
  TEST_ASSERT_TRUE(fake_esp32.watchdog_guards_loop);
}
