// What people do by hand: the stick, a test of one output, a parameter.
#include "../../suite.h"

#include <cmath>

#include "application_bench.h"

using namespace foldcar;

// Full forward stick is WHEEL_MAX_RAD_S: 1500 + 45 + 155 us forward at the default gain, mirrored on the right.
TEST(the_stick_drives_an_armed_car) {
  ApplicationBench bench;
  bench.application.begin();
  TEST_ASSERT_TRUE(bench.application.drive_manually(1.0f, 0.0f) == Refusal::kNotArmed);
  bench.application.arm();
  TEST_ASSERT_TRUE(bench.application.drive_manually(0.0f, 0.0f) == Refusal::kNone);
  bench.tick();
  TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
  for (int i = 0; i < 50; ++i) {
    bench.application.drive_manually(1.0f, 0.0f);
    bench.tick();
  }
  TEST_ASSERT_TRUE(bench.state() == State::kManual);
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1700.0f, bench.last_us()[0]);
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1300.0f, bench.last_us()[1]);
  for (int i = 0; i < 50; ++i) {
    bench.application.drive_manually(0.0f, 1.0f);
    bench.tick();
  }
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1300.0f, bench.last_us()[0]);  // left wheels backward, right ones forward
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1300.0f, bench.last_us()[1]);
  bench.run_ticks(26);
  TEST_ASSERT_TRUE(bench.fault() == Fault::kCommandStale);
  TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
  TEST_ASSERT_TRUE(bench.application.drive_manually(NAN, 0.0f) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(bench.application.drive_manually(1.1f, 0.0f) == Refusal::kNotANumber);
}

TEST(a_test_puts_its_pulse_on_one_output_only_and_ends) {
  ApplicationBench bench;
  bench.application.begin();
  TEST_ASSERT_TRUE(bench.application.test(2, 1480.0f, 0.2f) == Refusal::kNone);
  for (int i = 0; i < 9; ++i) {
    bench.tick();
    PulsesUs expected{};
    expected[2] = 1480.0f;
    TEST_ASSERT_TRUE(bench.last_us() == expected);
  }
  bench.tick();
  TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
  TEST_ASSERT_TRUE(bench.application.test(8, 1500.0f, 0.2f) == Refusal::kTest);
  TEST_ASSERT_TRUE(bench.application.test(0, 999.0f, 0.2f) == Refusal::kTest);
  TEST_ASSERT_TRUE(bench.application.test(0, 2001.0f, 0.2f) == Refusal::kTest);
  TEST_ASSERT_TRUE(bench.application.test(0, NAN, 0.2f) == Refusal::kTest);
}

TEST(a_parameter_that_is_set_is_saved_and_forgotten_on_request) {
  ApplicationBench bench;
  bench.application.begin();
  Application& application = bench.application;
  TEST_ASSERT_TRUE(application.set_parameter(Parameter::kTrackM, 0.2f) == SetResult::kOk);
  TEST_ASSERT_TRUE(application.unsaved_parameter() == Parameter::kTrackM);
  TEST_ASSERT_TRUE(application.save_parameter(Parameter::kTrackM));
  TEST_ASSERT_EQUAL_FLOAT(0.2f, bench.board.storage.values["TRACK_M"]);
  TEST_ASSERT_TRUE(application.set_parameter(Parameter::kTrackM, -1.0f) == SetResult::kBelowMinimum);
  TEST_ASSERT_FALSE(application.unsaved_parameter().has_value());
  TEST_ASSERT_TRUE(application.set_parameter(Parameter::kTrackM, 0.3f) == SetResult::kOk);
  TEST_ASSERT_TRUE(application.reset_parameters());
  TEST_ASSERT_FALSE_MESSAGE(application.unsaved_parameter().has_value(), "would be saved after the reset");
  TEST_ASSERT_TRUE(bench.board.storage.values.empty());
  TEST_ASSERT_EQUAL_FLOAT(0.111f, bench.parameters.get(Parameter::kTrackM));
}
