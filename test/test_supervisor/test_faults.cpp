// Faults: the battery, the first fault latched, how a trial ended.
#include "../suite.h"

#include <cmath>
#include <functional>

#include "supervisor_bench.h"

namespace foldcar {
namespace {

TEST(a_battery_that_recovers_starts_the_count_anew) {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV, 0);
  supervisor.start(kUntethered, 0);
  for (std::uint64_t time_ms = 0; time_ms < 9000; time_ms += 500) {
    tick(supervisor, ms(time_ms), kLowV);
    tick(supervisor, ms(time_ms + 480), kLowV);
    tick(supervisor, ms(time_ms + 490), kGoodV);
    TEST_ASSERT_TRUE(supervisor.state() == kRunning);
  }
}

TEST(a_minimum_of_zero_volts_allows_any_battery) {
  Parameters parameters;
  parameters.set("BATT_MIN_V", 0.0f);
  Supervisor supervisor(parameters);
  TEST_ASSERT_TRUE(supervisor.arm(0.0f, 0) == Refusal::kNone);
  supervisor.start(kUntethered, 0);
  tick(supervisor, ms(0), 0.0f);
  tick(supervisor, ms(5000), 0.0f);
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
}

TEST(the_first_fault_stays_until_it_is_acknowledged) {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV, 0);
  supervisor.start(kTrial, 0);
  tick(supervisor, ms(501), kGoodV);
  supervisor.report(Fault::kBus);
  tick(supervisor, ms(600), NAN);
  TEST_ASSERT_TRUE(supervisor.fault() == Fault::kCommandStale);
  TEST_ASSERT_TRUE(supervisor.acknowledge() == Refusal::kNone);
  TEST_ASSERT_TRUE(supervisor.fault() == Fault::kNone);
  TEST_ASSERT_TRUE(supervisor.state() == kDisarmed);
}

TEST(how_a_trial_ended_is_kept_until_the_next_one_starts) {
  const Parameters parameters;
  const auto end_after = [&parameters](const std::function<void(Supervisor&)>& event) {
    Supervisor supervisor(parameters);
    bring_to(kRunning, supervisor);
    TEST_ASSERT_TRUE(supervisor.trial_end() == TrialEnd::kNone);
    event(supervisor);
    const TrialEnd end = supervisor.trial_end();
    if (supervisor.state() == kFault) supervisor.acknowledge();
    supervisor.arm(kGoodV, 0);
    TEST_ASSERT_TRUE(supervisor.trial_end() == end);
    supervisor.start(kUntethered, ms(20000));
    TEST_ASSERT_TRUE(supervisor.trial_end() == TrialEnd::kNone);
    return end;
  };
  TEST_ASSERT_TRUE(end_after([](Supervisor& s) { s.stop(); }) == TrialEnd::kStopped);
  TEST_ASSERT_TRUE(end_after([](Supervisor& s) { s.disarm(); }) == TrialEnd::kDisarmed);
  TEST_ASSERT_TRUE(end_after([](Supervisor& s) { tick(s, ms(501), kGoodV); }) == TrialEnd::kFault);
  TEST_ASSERT_TRUE(end_after([](Supervisor& s) { tick(s, ms(10000), kGoodV); }) == TrialEnd::kTimeLimit);
}

}  // namespace

}  // namespace foldcar
