// The IMU: whether it is found, what it measures in SI units, what is told when it falls silent.
#include "../suite.h"

#include "feather_bench.h"

using namespace foldcar;

TEST(a_board_without_an_imu_has_none) {
  BegunBench bench;
  TEST_ASSERT_FALSE(bench.hal.imu.present());
}

TEST(an_imu_is_found_at_both_of_its_addresses) {
  for (const std::uint8_t address : {0x6A, 0x6B}) {
    FeatherBench bench;
    fake_esp32.i2c.chips[address] = &bench.imu_chip;
    bench.begin();
    TEST_ASSERT_TRUE(bench.hal.imu.present());
  }
}

TEST(another_chip_at_its_address_is_no_imu) {
  FeatherBench bench(true);
  bench.imu_chip.identity = 0x6B;  // an LSM6DSR
  bench.begin();
  TEST_ASSERT_FALSE(bench.hal.imu.present());
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
