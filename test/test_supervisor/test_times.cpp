// What time ends: trials, tethered ones without a host, a car left armed.
#include "../suite.h"

#include "supervisor_bench.h"

namespace foldcar {
namespace {

TEST(a_trial_ends_at_its_time_limit_and_not_before) {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV, 0);
  supervisor.start({0.1f, 0.0f, 2.5f, true, 0}, ms(1000));
  tick(supervisor, ms(3500) - 1, kGoodV);
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
  tick(supervisor, ms(3500), kGoodV);
  TEST_ASSERT_TRUE(supervisor.state() == kFinished);
  TEST_ASSERT_EQUAL_UINT64(ms(2500), supervisor.trial_elapsed_us());
  tick(supervisor, ms(9000), kGoodV);
  TEST_ASSERT_EQUAL_UINT64(ms(2500), supervisor.trial_elapsed_us());
}

TEST(a_second_trial_counts_its_own_time) {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV, 0);
  supervisor.start(kUntethered, 0);
  tick(supervisor, ms(10000), kGoodV);
  supervisor.arm(kGoodV, 0);
  supervisor.start(kUntethered, ms(20000));
  TEST_ASSERT_EQUAL_UINT64(0, supervisor.trial_elapsed_us());
  tick(supervisor, ms(29999), kGoodV);
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
}

TEST(refreshing_keeps_a_tethered_trial_alive) {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV, 0);
  supervisor.start(kTrial, 0);
  for (std::uint64_t time_ms = 400; time_ms <= 4000; time_ms += 400) {
    supervisor.refresh_command(ms(time_ms));
    tick(supervisor, ms(time_ms + 390), kGoodV);
    TEST_ASSERT_TRUE(supervisor.state() == kRunning);
  }
  tick(supervisor, ms(4450), kGoodV);
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
  tick(supervisor, ms(4451), kGoodV);
  TEST_ASSERT_TRUE(supervisor.fault() == Fault::kCommandStale);
}

TEST(an_untethered_trial_needs_no_refresh) {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV, 0);
  supervisor.start(kUntethered, 0);
  tick(supervisor, ms(9999), kGoodV);
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
}

TEST(an_armed_car_that_is_left_alone_disarms) {
  Parameters parameters;
  parameters.set("ARM_TIMEOUT_S", 3.0f);
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV, ms(1000));
  supervisor.refresh_command(ms(2000));
  tick(supervisor, ms(5000), kGoodV);
  TEST_ASSERT_TRUE(supervisor.state() == kArmed && !supervisor.left_alone());
  tick(supervisor, ms(5001), kGoodV);
  TEST_ASSERT_TRUE(supervisor.state() == kDisarmed && supervisor.left_alone());
  tick(supervisor, ms(9000), kGoodV);
  TEST_ASSERT_TRUE(supervisor.left_alone());
  supervisor.arm(kGoodV, ms(10000));
  TEST_ASSERT_FALSE(supervisor.left_alone());
}

}  // namespace

}  // namespace foldcar
