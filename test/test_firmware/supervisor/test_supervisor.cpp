// What time ends, the faults that are latched, and requests that are refused with their reasons.
#include "../../suite.h"

#include <cmath>
#include <functional>
#include <limits>

#include "supervisor_bench.h"

using namespace foldcar;

TEST(a_trial_ends_at_its_time_limit_and_a_second_one_counts_its_own_time) {
  SupervisorBench bench;
  bench.start(kUntethered);
  TEST_ASSERT_TRUE(bench.tick(ms(9999)) == kRunning);
  TEST_ASSERT_TRUE(bench.tick(ms(10000)) == kFinished);
  bench.tick(ms(12000));
  TEST_ASSERT_EQUAL_UINT64(ms(10000), bench.supervisor.trial_elapsed_us());
  bench.start(kUntethered, ms(20000));
  TEST_ASSERT_EQUAL_UINT64(0, bench.supervisor.trial_elapsed_us());
  TEST_ASSERT_TRUE(bench.tick(ms(29999)) == kRunning);
}

TEST(refreshing_keeps_a_tethered_trial_alive) {
  SupervisorBench bench;
  bench.start(kTrial);
  for (std::uint64_t time_ms = 400; time_ms <= 4000; time_ms += 400) {
    bench.supervisor.refresh_command(ms(time_ms));
    TEST_ASSERT_TRUE(bench.tick(ms(time_ms + 390)) == kRunning);
  }
  TEST_ASSERT_TRUE(bench.tick(ms(4450)) == kRunning);
  bench.tick(ms(4451));
  TEST_ASSERT_TRUE(bench.supervisor.fault() == Fault::kCommandStale);
}

TEST(an_armed_car_that_is_left_alone_disarms) {
  SupervisorBench bench;
  Supervisor& supervisor = bench.supervisor;
  bench.parameters.set("ARM_TIMEOUT_S", 3.0f);
  supervisor.arm(kGoodV, ms(1000));
  supervisor.refresh_command(ms(2000));
  TEST_ASSERT_TRUE(bench.tick(ms(5000)) == kArmed && !supervisor.left_alone());
  TEST_ASSERT_TRUE(bench.tick(ms(5001)) == kDisarmed && supervisor.left_alone());
  bench.tick(ms(9000));
  TEST_ASSERT_TRUE(supervisor.left_alone());
  supervisor.arm(kGoodV, ms(10000));
  TEST_ASSERT_FALSE(supervisor.left_alone());
}

TEST(a_battery_that_recovers_starts_the_count_anew) {
  SupervisorBench bench;
  bench.start(kUntethered);
  for (std::uint64_t time_ms = 0; time_ms < 9000; time_ms += 500) {
    bench.tick(ms(time_ms), kLowV);
    bench.tick(ms(time_ms + 480), kLowV);
    TEST_ASSERT_TRUE(bench.tick(ms(time_ms + 490)) == kRunning);
  }
}

TEST(a_minimum_of_zero_volts_allows_any_battery) {
  SupervisorBench bench;
  bench.parameters.set("BATT_MIN_V", 0.0f);
  TEST_ASSERT_TRUE(bench.supervisor.arm(0.0f, 0) == Refusal::kNone);
  bench.supervisor.start(kUntethered, 0);
  bench.tick(ms(0), 0.0f);
  TEST_ASSERT_TRUE(bench.tick(ms(5000), 0.0f) == kRunning);
}

TEST(the_first_fault_stays_until_it_is_acknowledged) {
  SupervisorBench bench;
  bench.start(kTrial);
  bench.tick(ms(501));
  bench.supervisor.report(Fault::kBus);
  bench.tick(ms(600), NAN);
  TEST_ASSERT_TRUE(bench.supervisor.fault() == Fault::kCommandStale);
  TEST_ASSERT_TRUE(bench.supervisor.acknowledge() == Refusal::kNone);
  TEST_ASSERT_TRUE(bench.supervisor.fault() == Fault::kNone);
  TEST_ASSERT_TRUE(bench.supervisor.state() == kDisarmed);
}

TEST(how_a_trial_ended_is_kept_until_the_next_one_starts) {
  const auto end_after = [](const std::function<void(SupervisorBench&)>& event) {
    SupervisorBench bench;
    Supervisor& supervisor = bench.supervisor;
    bench.bring_to(kRunning);
    TEST_ASSERT_TRUE(supervisor.trial_end() == TrialEnd::kNone);
    event(bench);
    const TrialEnd end = supervisor.trial_end();
    if (supervisor.state() == kFault) supervisor.acknowledge();
    supervisor.arm(kGoodV, 0);
    TEST_ASSERT_TRUE(supervisor.trial_end() == end);
    supervisor.start(kUntethered, ms(20000));
    TEST_ASSERT_TRUE(supervisor.trial_end() == TrialEnd::kNone);
    return end;
  };
  TEST_ASSERT_TRUE(end_after([](SupervisorBench& b) { b.supervisor.stop(); }) == TrialEnd::kStopped);
  TEST_ASSERT_TRUE(end_after([](SupervisorBench& b) { b.supervisor.disarm(); }) == TrialEnd::kDisarmed);
  TEST_ASSERT_TRUE(end_after([](SupervisorBench& b) { b.tick(ms(501)); }) == TrialEnd::kFault);
  TEST_ASSERT_TRUE(end_after([](SupervisorBench& b) { b.tick(ms(10000)); }) == TrialEnd::kTimeLimit);
}

TEST(a_request_beyond_the_limits_is_refused_with_its_reason) {
  const auto answer = [](float speed_m_s, float yaw_rate_rad_s, float time_s) {
    SupervisorBench bench;
    bench.parameters.set("TRIAL_MAX_S", 20.0f);
    const Refusal refusal = bench.start({speed_m_s, yaw_rate_rad_s, time_s, false, 0});
    TEST_ASSERT_TRUE(bench.supervisor.pulses_enabled() == (refusal == Refusal::kNone));
    return refusal;
  };
  const float infinity = std::numeric_limits<float>::infinity();
  TEST_ASSERT_TRUE(answer(NAN, 0.0f, 1.0f) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer(0.1f, NAN, 1.0f) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer(0.1f, 0.0f, NAN) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer(5.0f, 100.0f, 1.0f) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer(-5.0f, -100.0f, 1.0f) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer(5.001f, 0.0f, 1.0f) == Refusal::kSpeedLimit);
  TEST_ASSERT_TRUE(answer(-infinity, 0.0f, 1.0f) == Refusal::kSpeedLimit);
  TEST_ASSERT_TRUE(answer(0.1f, -100.1f, 1.0f) == Refusal::kYawRateLimit);
  for (const float time_s : {0.0f, -1.0f, 20.01f, infinity}) {
    TEST_ASSERT_TRUE(answer(0.1f, 0.0f, time_s) == Refusal::kTimeLimit);
  }
  TEST_ASSERT_TRUE_MESSAGE(answer(0.1f, 0.0f, 20.0f) == Refusal::kNone, "the longest trial is a parameter");
}

TEST(a_car_without_a_wheel_on_a_side_does_not_start) {
  const auto answer = [](std::initializer_list<std::pair<const char*, float>> sides) {
    SupervisorBench bench;
    for (const auto& [name, side] : sides) bench.parameters.set(name, side);
    return bench.start(kTrial);
  };
  TEST_ASSERT_TRUE(answer({{"CH2_SIDE", 0.0f}}) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer({{"CH2_SIDE", 0.0f}, {"CH4_SIDE", 0.0f}}) == Refusal::kNoWheels);
  TEST_ASSERT_TRUE(answer({{"CH2_SIDE", 0.0f}, {"CH4_SIDE", 0.0f}, {"CH8_SIDE", 2.0f}}) == Refusal::kNone);
}
