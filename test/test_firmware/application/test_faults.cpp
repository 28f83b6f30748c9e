// Faults of the hardware while the application runs: servo driver, battery, IMU, tilt.
#include "../../suite.h"

#include "application_bench.h"

using namespace foldcar;

TEST(a_driver_or_an_imu_that_stops_answering_stops_the_car_with_an_off_write) {
  for (const Fault fault : {Fault::kBus, Fault::kImu}) {
    ApplicationBench bench;
    bench.board.fit_imu();
    bench.run();
    bench.tick();
    (fault == Fault::kBus ? bench.board.servos.answers : bench.board.imu.answers) = false;
    bench.tick();
    TEST_ASSERT_TRUE(bench.fault() == fault);
    TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
    TEST_ASSERT_FALSE(any_pulse(bench.application.status().pulses_us));
  }
}

TEST(a_bus_fault_comes_back_until_the_driver_answers) {
  ApplicationBench bench;
  bench.board.servos.answers = false;
  bench.application.begin();
  TEST_ASSERT_TRUE(bench.fault() == Fault::kBus);
  bench.application.acknowledge();
  bench.tick();
  TEST_ASSERT_TRUE(bench.state() == State::kFault);
  bench.board.servos.answers = true;
  bench.application.acknowledge();
  bench.tick();
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
}

TEST(a_short_dip_of_the_battery_does_not_end_a_trial_and_a_long_one_does) {
  ApplicationBench bench;
  bench.run();
  const auto low_for = [&bench](int tick_count) {
    bench.board.battery.volts = 3.0f;
    bench.run_ticks(tick_count);
    bench.board.battery.volts = 4.0f;
    bench.tick();
    return bench.fault();
  };
  TEST_ASSERT_TRUE(low_for(25) == Fault::kNone);  // 480 ms from the first to the last low reading
  TEST_ASSERT_TRUE(low_for(26) == Fault::kBatteryLow);
}

TEST(a_car_that_lies_on_its_side_stops_if_it_has_an_imu) {
  ApplicationBench bench;
  bench.board.fit_imu();
  bench.run();
  bench.run_ticks(10);
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
  bench.board.imu.now.acceleration_m_s2 = {0.0f, 9.81f, 0.0f};
  int ticks = 0;
  for (; ticks < 200 && bench.application.is_driving(); ++ticks) bench.tick();
  TEST_ASSERT_TRUE(bench.fault() == Fault::kTilt);
  TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
  // Gravity turns the estimate with a time constant of 0.5 s; then 0.3 s must pass.
  TEST_ASSERT_TRUE(ticks > 15 && ticks < 80);
}
