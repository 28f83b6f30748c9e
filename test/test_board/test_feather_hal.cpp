// The real board's HAL over fakes of the Arduino calls that it makes: the contract of hal.h, then each part's own promises.
#include "../suite.h"

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
  fake_esp32.flash.is_formatted = false;
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
