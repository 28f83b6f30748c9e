// The whole firmware on the board's HAL: from a host's packets on the serial port to pulses on the servo driver's outputs.
#include "../suite.h"

#include <string>

#include "../mavlink_host.h"
#include "feather_bench.h"
#include "firmware.h"

using namespace foldcar;

static constexpr const char* kBuild = "00112233445566ff";

struct WholeBoard {
  FeatherBench bench;
  Firmware firmware{bench.hal.hal(), kBuild};
  MavlinkHost host;

  // Reading car.json needs ArduinoJson (test_flash.cpp): a file system counts as one with a design.
  explicit WholeBoard(bool flash_is_formatted = true) : bench(true) {
    fake_esp32.flash.is_formatted = flash_is_formatted;
    bench.begin();
    DesignResult design;
    if (!flash_is_formatted) design.source = DesignSource::kUnreadable;
    firmware.begin(design);
    while (firmware.store_log()) {
    }
  }
  MAV_RESULT answer(std::uint16_t command, const std::vector<float>& values) {
    run(60, host.heartbeat() + host.command(command, values));
    return static_cast<MAV_RESULT>(host.acks().back().result);
  }
  // The host's bytes arrive, and loop() comes round every millisecond; the UART sends 11.5 bytes in each.
  void run(int time_ms, const std::string& bytes = "") {
    for (const char byte : bytes) fake_esp32.uart.receive_buffer.push_back(static_cast<std::uint8_t>(byte));
    for (int ms = 0; ms < time_ms; ++ms) {
      firmware.poll();
      firmware.store_log();
      fake_esp32.time_us += 1000;
      std::size_t& waiting = fake_esp32.uart.transmit_fifo;
      waiting -= std::min<std::size_t>(waiting, 11);
    }
    host.receive(fake_esp32.uart.transmitted);
    fake_esp32.uart.transmitted.clear();
  }
  void start_trial(float untethered) {
    run(50, host.heartbeat() + host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
    run(50, host.heartbeat() + host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.69f, 0.0f, 5.0f, untethered, 7.0f}));
    TEST_ASSERT_TRUE(firmware.application().status().state == State::kRunning);
  }
  double pulse_us(std::size_t channel) const { return bench.servo_chip.pulse_us(channel); }
};

// Full speed is 200 µs from neutral, mirrored on the right; the four wheels of the default parameters use outputs 0 to 3.
TEST(a_trial_asked_for_over_usb_drives_the_outputs_until_the_host_is_silent) {
  WholeBoard car;
  car.start_trial(0.0f);
  for (int i = 0; i < 4; ++i) car.run(200, car.host.heartbeat());
  const float expected_us[] = {1700.0f, 1300.0f, 1700.0f, 1300.0f, 0.0f, 0.0f, 0.0f, 0.0f};
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
    TEST_ASSERT_FLOAT_WITHIN(2.5f, expected_us[channel], static_cast<float>(car.pulse_us(channel)));
  }
  car.run(500);
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) TEST_ASSERT_TRUE(car.pulse_us(channel) == 0);
  TEST_ASSERT_TRUE(car.firmware.application().status().fault == Fault::kCommandStale);
  TEST_ASSERT_EQUAL_INT(0, car.host.bad_count);
  TEST_ASSERT_FALSE(fake_esp32.uart.write_waited);
}

TEST(an_untethered_trial_leaves_a_log_in_flash) {
  WholeBoard car;
  car.start_trial(1.0f);
  car.run(5200);
  TEST_ASSERT_TRUE(car.firmware.application().trial_end() == TrialEnd::kTimeLimit);
  std::string log(car.bench.hal.logs.size(1), '\0');
  car.bench.hal.logs.read(1, 0, reinterpret_cast<std::uint8_t*>(log.data()), log.size());
  MavlinkHost reader;
  TEST_ASSERT_TRUE(reader.receive_log(log));
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, reader.trials().back().end);
}

TEST(a_flash_that_does_not_mount_is_told_and_keeps_the_car_disarmed) {
  WholeBoard car(false);
  car.run(1100, car.host.heartbeat());
  TEST_ASSERT_EQUAL_STRING("fault: flash memory cannot be read", car.host.texts().front().c_str());
  const auto beats = car.host.all<mavlink_heartbeat_t>(MAVLINK_MSG_ID_HEARTBEAT, mavlink_msg_heartbeat_decode);
  TEST_ASSERT_EQUAL_UINT8(MAV_STATE_CRITICAL, beats.back().system_status);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_FAULT_FLASH, car.host.trials().back().fault);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, car.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, car.answer(MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, {}));
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, car.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  TEST_ASSERT_FALSE(fake_esp32.flash.is_formatted);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, car.answer(MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, {1}));
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, car.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
}
