// setup() and loop() of the real car: what the board does first, and which task does what.
#include "../suite.h"

#include <freertos/task.h>
#include <freertos/xtensa_context.h>

#include <string>

#include "../../firmware/src/main.cpp"
#include "../hal_contract.h"
#include "../mavlink_host.h"
#include "feather_bench.h"

using namespace foldcar;

// The servo driver's chip, which notes what of the board was at work when its outputs were turned off.
struct WatchedChip : FakePca9685 {
  bool is_off = false;
  bool others_came_first = false;
  bool write(const std::vector<std::uint8_t>& bytes) override {
    if (!is_off) {
      const FakeFlash& flash = fake_esp32.flash;
      others_came_first = fake_esp32.uart.baud != 0 || flash.is_mounted || flash.nvs_is_open || fake_esp32.time_us != 0 ||
                          fake_esp32.task.function != nullptr || fake_esp32.watchdog_s != 0;
    }
    const bool taken = FakePca9685::write(bytes);
    is_off = is_off || bytes == std::vector<std::uint8_t>{0xFD, 0x10};
    return taken;
  }
};

static WatchedChip servo_chip;

// A board whose watchdog has restarted it: the chip still drives, at 50 Hz.
static void start_board() {
  fake_esp32 = {};
  fake_esp32.pin_mv[35] = 1900;
  fake_esp32.reset_reason = 6;
  fake_esp32.i2c.chips[0x40] = &servo_chip;
  servo_chip.is_off = true;
  drive_from_before(servo_chip);
  servo_chip.is_off = false;
  servo_chip.oscillator_hz = 26e6;
  for (const auto& [name, value] : {std::pair("OE_WIRED", 1.0f), std::pair("PWM_OSC_HZ", 26e6f)}) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
    fake_esp32.flash.nvs["foldcar"][name].assign(bytes, bytes + sizeof value);
  }
  setup();
}

// main.cpp keeps one car, so this is one test.
TEST(the_board_turns_its_outputs_off_first_and_drives_and_stores_in_two_tasks) {
  start_board();
  const std::vector<std::uint8_t> all_off = {0xFD, 0x10};
  TEST_ASSERT_TRUE(servo_chip.transmissions.front() == all_off);
  TEST_ASSERT_FALSE(servo_chip.has_driven);
  TEST_ASSERT_FALSE_MESSAGE(servo_chip.others_came_first, "serial port, flash or a task before the outputs are off");
  TEST_ASSERT_FLOAT_WITHIN(50.0f, 20000.0f, static_cast<float>(servo_chip.period_us()));
  TEST_ASSERT_EQUAL_INT_MESSAGE(HIGH, fake_esp32.pin_levels.at(27), "output enable is wired, and off");
  TEST_ASSERT_EQUAL_UINT32(1, fake_esp32.watchdog_s);
  TEST_ASSERT_TRUE(fake_esp32.watchdog_panics && fake_esp32.watchdog_guards_loop);

  const FakeTask& task = fake_esp32.task;
  TEST_ASSERT_EQUAL_UINT(0, task.priority);
  TEST_ASSERT_EQUAL_INT(0, task.core);
  TEST_ASSERT_EQUAL_UINT(8192, task.stack_size);

  MavlinkHost host;
  const auto run = [&host](int time_ms, const std::string& bytes, bool stores) {
    for (const char byte : host.heartbeat() + bytes) {
      fake_esp32.uart.receive_buffer.push_back(static_cast<std::uint8_t>(byte));
    }
    for (int ms = 0; ms < time_ms; ++ms) {
      loop();
      if (stores) run_fake_task();
      fake_esp32.uart.transmit_fifo = 0;
    }
    host.receive(fake_esp32.uart.transmitted);
    fake_esp32.uart.transmitted.clear();
  };
  run(60, host.command(MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, {1}), true);
  run(60, host.command(MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, {1}), true);
  run(60, host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}), true);
  run(60, host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.2f, 0, 1, 1, 7}), true);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, host.acks().back().result);
  TEST_ASSERT_TRUE(servo_chip.pulse_us(0) > 0);
  TEST_ASSERT_EQUAL_INT(LOW, fake_esp32.pin_levels.at(27));
  const int programmed = fake_esp32.flash.programmed_count, erased = fake_esp32.flash.erased_count;
  run(1100, "", false);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_OPEN, host.trials().back().log);
  TEST_ASSERT_EQUAL_INT_MESSAGE(programmed, fake_esp32.flash.programmed_count, "loop() has written to flash");
  TEST_ASSERT_EQUAL_INT(erased, fake_esp32.flash.erased_count);
  run(200, "", true);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, host.trials().back().log);
  TEST_ASSERT_TRUE(fake_esp32.flash.programmed_count > programmed);
  TEST_ASSERT_EQUAL_UINT32_MESSAGE(20, task.delay_ms, "a task with nothing to do makes room");

  // Where loop() hangs while wheels are driven, the board restarts long before the SDK's watchdog would see it.
  run(60, host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}), true);
  run(60, host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.2f, 0, 1, 1, 8}), true);
  TEST_ASSERT_TRUE(servo_chip.pulse_us(0) > 0);
  const XtExcFrame frame{1, 0x400D1234, 0, 0, 0, 0, 0};
  fake_esp32.loop_stack_top = &frame;
  TEST_ASSERT_UINT32_WITHIN_MESSAGE(10, 240, ms_until_restart(), "250 ms from the last tick, which was up to 20 ms ago");
}

TEST(without_memory_for_the_task_no_log_is_promised) {
  fake_esp32 = {};
  fake_esp32.heap_is_full = true;
  TEST_ASSERT_FALSE(start_background_task([](void*) { return false; }, nullptr));
  BegunBench bench;
  TEST_ASSERT_TRUE(bench.hal.logs.present());
  bench.hal.logs.give_up();
  check_logs_give_back_what_they_took(bench.hal.logs);
}
