// The supervisor: the whole table of states and events, refusals of requests, faults, time limits.
#include <unity.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <vector>

#include "supervisor.h"

using namespace foldcar;

void setUp() {}
void tearDown() {}

namespace {

constexpr float kGoodV = 4.0f;
constexpr float kLowV = 3.0f;
constexpr TrialRequest kTrial{0.2f, 0.0f, 10.0f, false};
constexpr TrialRequest kUntethered{0.2f, 0.0f, 10.0f, true};

constexpr std::uint64_t ms(std::uint64_t time_ms) { return 1000 * time_ms; }

// All by legal events at time 0.
void bring_to(State state, Supervisor& supervisor) {
  if (state == State::kDisarmed) return;
  supervisor.arm(kGoodV);
  if (state == State::kArmed) return;
  if (state == State::kFault) return supervisor.report(Fault::kBus);
  supervisor.start(kTrial, 0);
  if (state == State::kFinished) supervisor.stop();
}

struct Expected {
  State state;
  Refusal refusal;
};

struct Event {
  const char* name;
  std::function<Refusal(Supervisor&)> happen;
  Expected expected[5];  // in the order of State
};

Refusal tick(Supervisor& supervisor, std::uint64_t now_us, float battery_v) {
  supervisor.tick({now_us, battery_v});
  return Refusal::kNone;
}

constexpr State kDisarmed = State::kDisarmed;
constexpr State kArmed = State::kArmed;
constexpr State kRunning = State::kRunning;
constexpr State kFinished = State::kFinished;
constexpr State kFault = State::kFault;
constexpr Refusal kOk = Refusal::kNone;

// docs/firmware.md holds this table in words.
const std::vector<Event> kTable = {
    {"arm", [](Supervisor& s) { return s.arm(kGoodV); },
     {{kArmed, kOk},
      {kArmed, kOk},
      {kRunning, Refusal::kRunning},
      {kArmed, kOk},
      {kFault, Refusal::kFaultLatched}}},
    {"arm with a low battery", [](Supervisor& s) { return s.arm(kLowV); },
     {{kDisarmed, Refusal::kBatteryLow},
      {kArmed, Refusal::kBatteryLow},
      {kRunning, Refusal::kRunning},
      {kFinished, Refusal::kBatteryLow},
      {kFault, Refusal::kFaultLatched}}},
    {"arm with an unreadable battery", [](Supervisor& s) { return s.arm(NAN); },
     {{kDisarmed, Refusal::kBatteryUnreadable},
      {kArmed, Refusal::kBatteryUnreadable},
      {kRunning, Refusal::kRunning},
      {kFinished, Refusal::kBatteryUnreadable},
      {kFault, Refusal::kFaultLatched}}},
    {"disarm", [](Supervisor& s) { return s.disarm(); },
     {{kDisarmed, kOk},
      {kDisarmed, kOk},
      {kDisarmed, kOk},
      {kDisarmed, kOk},
      {kFault, Refusal::kFaultLatched}}},
    {"start", [](Supervisor& s) { return s.start(kTrial, ms(50)); },
     {{kDisarmed, Refusal::kNotArmed},
      {kRunning, kOk},
      {kRunning, Refusal::kRunning},
      {kFinished, Refusal::kNotArmed},
      {kFault, Refusal::kFaultLatched}}},
    {"start with a bad request", [](Supervisor& s) { return s.start({NAN, 0.0f, 10.0f, false}, ms(50)); },
     {{kDisarmed, Refusal::kNotArmed},
      {kArmed, Refusal::kNotANumber},
      {kRunning, Refusal::kRunning},
      {kFinished, Refusal::kNotArmed},
      {kFault, Refusal::kFaultLatched}}},
    {"stop", [](Supervisor& s) { return s.stop(); },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kFinished, kOk}, {kFinished, kOk}, {kFault, kOk}}},
    {"acknowledge", [](Supervisor& s) { return s.acknowledge(); },
     {{kDisarmed, Refusal::kNoFault},
      {kArmed, Refusal::kNoFault},
      {kRunning, Refusal::kNoFault},
      {kFinished, Refusal::kNoFault},
      {kDisarmed, kOk}}},
    {"refresh the command", [](Supervisor& s) { return s.refresh_command(ms(50)); },
     {{kDisarmed, Refusal::kNotRunning},
      {kArmed, Refusal::kNotRunning},
      {kRunning, kOk},
      {kFinished, Refusal::kNotRunning},
      {kFault, Refusal::kFaultLatched}}},
    {"a fault is reported",
     [](Supervisor& s) {
       s.report(Fault::kBus);
       return kOk;
     },
     {{kFault, kOk}, {kFault, kOk}, {kFault, kOk}, {kFault, kOk}, {kFault, kOk}}},
    {"a tick without anything", [](Supervisor& s) { return tick(s, ms(100), kGoodV); },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kRunning, kOk}, {kFinished, kOk}, {kFault, kOk}}},
    {"the time limit passes", [](Supervisor& s) { return tick(s, ms(10000), kGoodV); },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kFinished, kOk}, {kFinished, kOk}, {kFault, kOk}}},
    {"the host is silent", [](Supervisor& s) { return tick(s, ms(501), kGoodV); },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kFault, kOk}, {kFinished, kOk}, {kFault, kOk}}},
    {"the battery dips",
     [](Supervisor& s) {
       tick(s, ms(20), kLowV);
       return tick(s, ms(499), kLowV);
     },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kRunning, kOk}, {kFinished, kOk}, {kFault, kOk}}},
    {"the battery stays low",
     [](Supervisor& s) {
       tick(s, ms(0), kLowV);
       return tick(s, ms(500), kLowV);
     },
     {{kDisarmed, kOk}, {kFault, kOk}, {kFault, kOk}, {kFinished, kOk}, {kFault, kOk}}},
    {"the battery becomes unreadable", [](Supervisor& s) { return tick(s, ms(20), NAN); },
     {{kDisarmed, kOk}, {kFault, kOk}, {kFault, kOk}, {kFinished, kOk}, {kFault, kOk}}},
};

Refusal answer(const TrialRequest& request, const Parameters& parameters = Parameters()) {
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV);
  const Refusal refusal = supervisor.start(request, 0);
  TEST_ASSERT_TRUE(supervisor.pulses_enabled() == (refusal == Refusal::kNone));
  return refusal;
}

}  // namespace

void every_event_in_every_state_does_what_the_table_says() {
  const Parameters parameters;
  for (const Event& event : kTable) {
    for (const State from : {kDisarmed, kArmed, kRunning, kFinished, kFault}) {
      Supervisor supervisor(parameters);
      bring_to(from, supervisor);
      char name[80];
      std::snprintf(name, sizeof name, "%s when %s", event.name, text(from));
      TEST_ASSERT_TRUE_MESSAGE(supervisor.state() == from, name);

      const Refusal refusal = event.happen(supervisor);

      const Expected& expected = event.expected[static_cast<std::size_t>(from)];
      TEST_ASSERT_EQUAL_STRING_MESSAGE(text(expected.state), text(supervisor.state()), name);
      TEST_ASSERT_EQUAL_STRING_MESSAGE(text(expected.refusal), text(refusal), name);
      TEST_ASSERT_TRUE_MESSAGE(supervisor.pulses_enabled() == (supervisor.state() == kRunning), name);
      TEST_ASSERT_TRUE_MESSAGE((supervisor.fault() != Fault::kNone) == (supervisor.state() == kFault), name);
    }
  }
}

void a_request_beyond_the_limits_is_refused_with_its_reason() {
  const float infinity = std::numeric_limits<float>::infinity();
  TEST_ASSERT_TRUE(answer({NAN, 0.0f, 1.0f}) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer({0.1f, NAN, 1.0f}) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, NAN}) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer({5.0f, 100.0f, 1.0f}) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer({-5.0f, -100.0f, 1.0f}) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer({5.001f, 0.0f, 1.0f}) == Refusal::kSpeedLimit);
  TEST_ASSERT_TRUE(answer({-infinity, 0.0f, 1.0f}) == Refusal::kSpeedLimit);
  TEST_ASSERT_TRUE(answer({0.1f, -100.1f, 1.0f}) == Refusal::kYawRateLimit);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, 0.0f}) == Refusal::kTimeLimit);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, -1.0f}) == Refusal::kTimeLimit);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, infinity}) == Refusal::kTimeLimit);
}

void the_longest_trial_is_a_parameter() {
  Parameters parameters;
  parameters.set("TRIAL_MAX_S", 20.0f);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, 20.0f}, parameters) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, 20.01f}, parameters) == Refusal::kTimeLimit);
}

void a_car_without_a_wheel_on_a_side_does_not_start() {
  Parameters parameters;
  parameters.set("CH2_SIDE", 0.0f);
  TEST_ASSERT_TRUE(answer(kTrial, parameters) == Refusal::kNone);
  parameters.set("CH4_SIDE", 0.0f);
  TEST_ASSERT_TRUE(answer(kTrial, parameters) == Refusal::kNoWheels);
  parameters.set("CH8_SIDE", 2.0f);
  TEST_ASSERT_TRUE(answer(kTrial, parameters) == Refusal::kNone);
}

void a_trial_ends_at_its_time_limit_and_not_before() {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV);
  supervisor.start({0.1f, 0.0f, 2.5f, true}, ms(1000));
  supervisor.tick({ms(3500) - 1, kGoodV});
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
  supervisor.tick({ms(3500), kGoodV});
  TEST_ASSERT_TRUE(supervisor.state() == kFinished);
  TEST_ASSERT_EQUAL_UINT64(ms(2500), supervisor.trial_elapsed_us());
  supervisor.tick({ms(9000), kGoodV});
  TEST_ASSERT_EQUAL_UINT64(ms(2500), supervisor.trial_elapsed_us());
}

void refreshing_keeps_a_tethered_trial_alive() {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV);
  supervisor.start(kTrial, 0);
  for (std::uint64_t time_ms = 400; time_ms <= 4000; time_ms += 400) {
    supervisor.refresh_command(ms(time_ms));
    supervisor.tick({ms(time_ms + 390), kGoodV});
    TEST_ASSERT_TRUE(supervisor.state() == kRunning);
  }
  supervisor.tick({ms(4500), kGoodV});
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
  supervisor.tick({ms(4501), kGoodV});
  TEST_ASSERT_TRUE(supervisor.fault() == Fault::kCommandStale);
}

void an_untethered_trial_needs_no_refresh() {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV);
  supervisor.start(kUntethered, 0);
  supervisor.tick({ms(9999), kGoodV});
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
}

void a_battery_that_recovers_starts_the_count_anew() {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV);
  supervisor.start(kUntethered, 0);
  for (std::uint64_t time_ms = 0; time_ms < 9000; time_ms += 500) {
    supervisor.tick({ms(time_ms), kLowV});
    supervisor.tick({ms(time_ms + 480), kLowV});
    supervisor.tick({ms(time_ms + 490), kGoodV});
    TEST_ASSERT_TRUE(supervisor.state() == kRunning);
  }
}

void a_minimum_of_zero_volts_allows_any_battery() {
  Parameters parameters;
  parameters.set("BATT_MIN_V", 0.0f);
  Supervisor supervisor(parameters);
  TEST_ASSERT_TRUE(supervisor.arm(0.0f) == Refusal::kNone);
  supervisor.start(kUntethered, 0);
  supervisor.tick({ms(0), 0.0f});
  supervisor.tick({ms(5000), 0.0f});
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
}

void the_first_fault_stays_until_it_is_acknowledged() {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV);
  supervisor.start(kTrial, 0);
  supervisor.tick({ms(501), kGoodV});
  supervisor.report(Fault::kBus);
  supervisor.tick({ms(600), NAN});
  TEST_ASSERT_TRUE(supervisor.fault() == Fault::kCommandStale);
  TEST_ASSERT_TRUE(supervisor.acknowledge() == Refusal::kNone);
  TEST_ASSERT_TRUE(supervisor.fault() == Fault::kNone);
  TEST_ASSERT_TRUE(supervisor.state() == kDisarmed);
}

void a_second_trial_counts_its_own_time() {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV);
  supervisor.start(kUntethered, 0);
  supervisor.tick({ms(10000), kGoodV});
  supervisor.arm(kGoodV);
  supervisor.start(kUntethered, ms(20000));
  TEST_ASSERT_EQUAL_UINT64(0, supervisor.trial_elapsed_us());
  supervisor.tick({ms(29999), kGoodV});
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
}

int main() {
  UNITY_BEGIN();
  RUN_TEST(every_event_in_every_state_does_what_the_table_says);
  RUN_TEST(a_request_beyond_the_limits_is_refused_with_its_reason);
  RUN_TEST(the_longest_trial_is_a_parameter);
  RUN_TEST(a_car_without_a_wheel_on_a_side_does_not_start);
  RUN_TEST(a_trial_ends_at_its_time_limit_and_not_before);
  RUN_TEST(refreshing_keeps_a_tethered_trial_alive);
  RUN_TEST(an_untethered_trial_needs_no_refresh);
  RUN_TEST(a_battery_that_recovers_starts_the_count_anew);
  RUN_TEST(a_minimum_of_zero_volts_allows_any_battery);
  RUN_TEST(the_first_fault_stays_until_it_is_acknowledged);
  RUN_TEST(a_second_trial_counts_its_own_time);
  UNITY_END();
  return 0;
}
