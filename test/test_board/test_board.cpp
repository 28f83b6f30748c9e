// The real board's HAL over fakes of the Arduino calls that it makes: the contract of hal.h, then clock, battery, serial
// port, reset, watchdog and IMU. Flash and servos have files of their own.
#include "../suite.h"

#include <esp_log.h>
#include <esp_system.h>

#include <cmath>
#include <cstring>

#include "../hal_contract.h"
#include "feather_bench.h"

using namespace foldcar;

TEST(the_boards_hal_keeps_the_contract) {
  for (const bool with_imu : {false, true}) {
    BegunBench bench(with_imu);
    check_hal_contract(bench.hal.hal(), [] { fake_esp32.time_us += 1000; });
  }
}

// Every part of the hardware is missing or broken; nothing is promised but that the firmware is told.
TEST(a_board_with_nothing_on_it_answers_false) {
  FeatherBench bench;
  fake_esp32.i2c.chips.clear();
  fake_esp32.flash.nvs_is_broken = true;
  fake_esp32.flash.logs.clear();
  bench.begin();
  const Hal hal = bench.hal.hal();
  TEST_ASSERT_FALSE(hal.servos.write_pulses(PulsesUs{}));
  check_imu_answers_if_present(hal.imu);
  check_logs_give_back_what_they_took(hal.logs);
  float value = 7.0f;
  TEST_ASSERT_FALSE(hal.storage.present());
  TEST_ASSERT_FALSE(hal.logs.present());
  TEST_ASSERT_FALSE(hal.storage.save("TRACK_M", 0.2f));
  TEST_ASSERT_FALSE(hal.storage.load("TRACK_M", value));
  TEST_ASSERT_FALSE(hal.storage.clear());
  TEST_ASSERT_EQUAL_FLOAT(7.0f, value);
}

TEST(the_clock_counts_on_where_32_bits_end) {
  FeatherBench bench;
  fake_esp32.time_us = 4294967295;  // 71.6 minutes
  TEST_ASSERT_EQUAL_UINT64(4294967295u, bench.hal.clock.now_us());
  fake_esp32.time_us += 1;
  TEST_ASSERT_EQUAL_UINT64(4294967296u, bench.hal.clock.now_us());
}

TEST(the_battery_has_twice_the_voltage_of_its_pin_or_there_is_none) {
  FeatherBench bench;
  TEST_ASSERT_EQUAL_FLOAT(3.8f, bench.hal.battery.voltage_v());
  fake_esp32.pin_mv[35] = 1250;
  TEST_ASSERT_EQUAL_FLOAT(2.5f, bench.hal.battery.voltage_v());
  // Of a broken divider the converter gives 142 mV, and the core 0 if the conversion fails.
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

TEST(the_board_is_no_simulator_and_restarts_after_the_last_byte_was_sent) {
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
  TEST_ASSERT_FALSE(bench.hal.board.is_simulated());
}

TEST(an_imu_is_found_at_both_of_its_addresses_and_another_chip_is_none) {
  for (const std::uint8_t address : {0x6A, 0x6B}) {
    for (const std::uint8_t identity : {0x6C, 0x6B}) {  // the other is an LSM6DSR
      FeatherBench bench;
      bench.imu_chip.identity = identity;
      fake_esp32.i2c.chips[address] = &bench.imu_chip;
      bench.begin();
      TEST_ASSERT_EQUAL_INT(identity == 0x6C, bench.hal.imu.present());
    }
  }
}

// The sensitivities are 0.122 mg and 17.5 mdps; the values stay within +-4 g and +-500 degrees/s.
TEST(a_sample_has_the_measured_values_within_a_bit) {
  FeatherBench bench(true);
  bench.imu_chip.acceleration_m_s2 = {-39.0, 9.81, 0.5};
  bench.imu_chip.rate_rad_s = {8.7, -8.7, -0.01};
  bench.begin();
  ImuSample sample;
  TEST_ASSERT_TRUE(bench.hal.imu.read(sample));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto acceleration_m_s2 = static_cast<float>(bench.imu_chip.acceleration_m_s2[axis]);
    const auto rate_rad_s = static_cast<float>(bench.imu_chip.rate_rad_s[axis]);
    TEST_ASSERT_FLOAT_WITHIN(0.0013f, acceleration_m_s2, sample.acceleration_m_s2[axis]);
    TEST_ASSERT_FLOAT_WITHIN(0.00031f, rate_rad_s, sample.rate_rad_s[axis]);
  }
}

TEST(an_imu_that_falls_silent_leaves_the_sample_alone) {
  BegunBench bench(true);
  fake_esp32.i2c.bus_hangs = true;
  ImuSample sample;
  sample.rate_rad_s[2] = 7.0f;
  TEST_ASSERT_FALSE(bench.hal.imu.read(sample));
  TEST_ASSERT_EQUAL_FLOAT(7.0f, sample.rate_rad_s[2]);
  TEST_ASSERT_TRUE(bench.hal.imu.present());
}

// It would hold the attitude, and with it the protection against tilting, for ever.
TEST(an_imu_that_was_switched_off_by_a_dip_of_its_supply_does_not_answer) {
  BegunBench bench(true);
  ImuSample sample;
  TEST_ASSERT_TRUE(bench.hal.imu.read(sample));
  bench.imu_chip.dip();
  sample.rate_rad_s[2] = 7.0f;
  TEST_ASSERT_FALSE(bench.hal.imu.read(sample));
  TEST_ASSERT_EQUAL_FLOAT(7.0f, sample.rate_rad_s[2]);
}

// With 20 and 10 kOhm at A2.
TEST(the_servos_battery_is_measured_where_it_is_wired) {
  FeatherBench bench;
  Parameters parameters;
  fake_esp32.pin_mv[34] = 1643;
  bench.hal.begin(115200);
  bench.hal.apply(parameters);
  TEST_ASSERT_FLOAT_IS_NAN(bench.hal.servo_battery.voltage_v());
  parameters.set(Parameter::kServoDivider, 3.0f);
  bench.hal.apply(parameters);
  TEST_ASSERT_FLOAT_WITHIN(1e-3f, 4.929f, bench.hal.servo_battery.voltage_v());
  fake_esp32.pin_mv[34] = 142;
  TEST_ASSERT_FLOAT_IS_NAN(bench.hal.servo_battery.voltage_v());
}

TEST(the_button_connects_its_pin_to_ground_and_the_led_is_the_boards) {
  FeatherBench bench;
  Parameters parameters;
  bench.hal.begin(115200);
  fake_esp32.grounded_pins = {32};
  bench.hal.apply(parameters);
  TEST_ASSERT_FALSE(bench.hal.board.button_is_pressed());
  TEST_ASSERT_EQUAL_UINT_MESSAGE(0, fake_esp32.pin_modes.count(32), "the pin is left alone");
  parameters.set(Parameter::kButtonWired, 1.0f);
  bench.hal.apply(parameters);
  TEST_ASSERT_EQUAL_INT(INPUT_PULLUP, fake_esp32.pin_modes.at(32));
  TEST_ASSERT_TRUE(bench.hal.board.button_is_pressed());
  fake_esp32.grounded_pins.clear();
  TEST_ASSERT_FALSE(bench.hal.board.button_is_pressed());
  for (const bool on : {true, false}) {
    bench.hal.board.set_led(on);
    TEST_ASSERT_EQUAL_INT(on ? HIGH : LOW, fake_esp32.pin_levels.at(13));
  }
}
