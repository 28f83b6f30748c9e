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
constexpr TrialRequest kTrial{0.2f, 0.0f, 10.0f, false, 1};
constexpr TrialRequest kUntethered{0.2f, 0.0f, 10.0f, true, 2};

constexpr std::uint64_t ms(std::uint64_t time_ms) { return 1000 * time_ms; }

// Brings a new supervisor into a state, by accepted requests at time 0.
void bring_to(State state, Supervisor& supervisor) {
  if (state == State::kDisarmed) return;
  if (state == State::kTesting) return static_cast<void>(supervisor.test(3.0f, kGoodV, 0));
  supervisor.arm(kGoodV, 0);
  if (state == State::kArmed) return;
  if (state == State::kFault) return supervisor.report(Fault::kBus);
  if (state == State::kManual) return static_cast<void>(supervisor.drive_manually(true, 0));
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
  Expected expected[7];  // in the order of State
};

Refusal tick(Supervisor& supervisor, std::uint64_t now_us, float battery_v, bool imu_lost = false,
             float tilt_rad = 0.0f) {
  supervisor.tick({now_us, battery_v, imu_lost, tilt_rad});
  return Refusal::kNone;
}

constexpr State kDisarmed = State::kDisarmed;
constexpr State kArmed = State::kArmed;
constexpr State kRunning = State::kRunning;
constexpr State kFinished = State::kFinished;
constexpr State kFault = State::kFault;
constexpr State kManual = State::kManual;
constexpr State kTesting = State::kTesting;
constexpr Refusal kBusy = Refusal::kRunning;
constexpr Refusal kLatched = Refusal::kFaultLatched;
constexpr float kTooFarRad = 1.2f;
constexpr Refusal kOk = Refusal::kNone;

// docs/firmware.md has this table too.
const std::vector<Event> kTable = {
    {"arm", [](Supervisor& s) { return s.arm(kGoodV, 0); },
     {{kArmed, kOk}, {kArmed, kOk}, {kRunning, kBusy}, {kArmed, kOk}, {kFault, kLatched}, {kManual, kBusy},
      {kTesting, kBusy}}},
    {"arm with a low battery", [](Supervisor& s) { return s.arm(kLowV, 0); },
     {{kDisarmed, Refusal::kBatteryLow}, {kArmed, Refusal::kBatteryLow}, {kRunning, kBusy},
      {kFinished, Refusal::kBatteryLow}, {kFault, kLatched}, {kManual, kBusy}, {kTesting, kBusy}}},
    {"arm with an unreadable battery", [](Supervisor& s) { return s.arm(NAN, 0); },
     {{kDisarmed, Refusal::kBatteryUnreadable}, {kArmed, Refusal::kBatteryUnreadable}, {kRunning, kBusy},
      {kFinished, Refusal::kBatteryUnreadable}, {kFault, kLatched}, {kManual, kBusy}, {kTesting, kBusy}}},
    {"arm with car.json refused",
     [](Supervisor& s) {
       s.refuse_design(Refusal::kDesign);
       return s.arm(kGoodV, 0);
     },
     {{kDisarmed, Refusal::kDesign}, {kArmed, Refusal::kDesign}, {kRunning, kBusy}, {kFinished, Refusal::kDesign},
      {kFault, kLatched}, {kManual, kBusy}, {kTesting, kBusy}}},
    {"arm without a car.json",
     [](Supervisor& s) {
       s.refuse_design(Refusal::kNoDesign);
       return s.arm(kGoodV, 0);
     },
     {{kDisarmed, Refusal::kNoDesign}, {kArmed, Refusal::kNoDesign}, {kRunning, kBusy},
      {kFinished, Refusal::kNoDesign}, {kFault, kLatched}, {kManual, kBusy}, {kTesting, kBusy}}},
    {"disarm", [](Supervisor& s) { return s.disarm(); },
     {{kDisarmed, kOk}, {kDisarmed, kOk}, {kDisarmed, kOk}, {kDisarmed, kOk}, {kFault, kLatched}, {kDisarmed, kOk},
      {kDisarmed, kOk}}},
    {"start", [](Supervisor& s) { return s.start(kTrial, ms(50)); },
     {{kDisarmed, Refusal::kNotArmed}, {kRunning, kOk}, {kRunning, kBusy}, {kFinished, Refusal::kNotArmed},
      {kFault, kLatched}, {kManual, kBusy}, {kTesting, kBusy}}},
    {"start with a bad request", [](Supervisor& s) { return s.start({NAN, 0.0f, 10.0f, false, 0}, ms(50)); },
     {{kDisarmed, Refusal::kNotArmed}, {kArmed, Refusal::kNotANumber}, {kRunning, kBusy},
      {kFinished, Refusal::kNotArmed}, {kFault, kLatched}, {kManual, kBusy}, {kTesting, kBusy}}},
    {"the stick moves", [](Supervisor& s) { return s.drive_manually(true, ms(50)); },
     {{kDisarmed, Refusal::kNotArmed}, {kManual, kOk}, {kRunning, kBusy}, {kFinished, Refusal::kNotArmed},
      {kFault, kLatched}, {kManual, kOk}, {kTesting, kBusy}}},
    {"the stick rests", [](Supervisor& s) { return s.drive_manually(false, ms(50)); },
     {{kDisarmed, Refusal::kNotArmed}, {kArmed, kOk}, {kRunning, kBusy}, {kFinished, Refusal::kNotArmed},
      {kFault, kLatched}, {kManual, kOk}, {kTesting, kBusy}}},
    {"test an output", [](Supervisor& s) { return s.test(1.0f, kGoodV, ms(50)); },
     {{kTesting, kOk}, {kArmed, Refusal::kNotDisarmed}, {kRunning, kBusy}, {kTesting, kOk}, {kFault, kLatched},
      {kManual, kBusy}, {kTesting, kOk}}},
    {"test an output for no time", [](Supervisor& s) { return s.test(0.0f, kGoodV, ms(50)); },
     {{kDisarmed, kOk}, {kArmed, Refusal::kNotDisarmed}, {kRunning, kBusy}, {kDisarmed, kOk}, {kFault, kLatched},
      {kManual, kBusy}, {kDisarmed, kOk}}},
    {"test an output for too long", [](Supervisor& s) { return s.test(3.1f, kGoodV, ms(50)); },
     {{kDisarmed, Refusal::kTest}, {kArmed, Refusal::kNotDisarmed}, {kRunning, kBusy}, {kFinished, Refusal::kTest},
      {kFault, kLatched}, {kManual, kBusy}, {kTesting, Refusal::kTest}}},
    {"test an output for no number of seconds", [](Supervisor& s) { return s.test(NAN, kGoodV, ms(50)); },
     {{kDisarmed, Refusal::kTest}, {kArmed, Refusal::kNotDisarmed}, {kRunning, kBusy}, {kFinished, Refusal::kTest},
      {kFault, kLatched}, {kManual, kBusy}, {kTesting, Refusal::kTest}}},
    {"test an output with a low battery", [](Supervisor& s) { return s.test(1.0f, kLowV, ms(50)); },
     {{kDisarmed, Refusal::kBatteryLow}, {kArmed, Refusal::kNotDisarmed}, {kRunning, kBusy},
      {kFinished, Refusal::kBatteryLow}, {kFault, kLatched}, {kManual, kBusy}, {kTesting, Refusal::kBatteryLow}}},
    {"test an output with car.json refused",
     [](Supervisor& s) {
       s.refuse_design(Refusal::kDesign);
       return s.test(1.0f, kGoodV, ms(50));
     },
     {{kDisarmed, Refusal::kDesign}, {kArmed, Refusal::kNotDisarmed}, {kRunning, kBusy},
      {kFinished, Refusal::kDesign}, {kFault, kLatched}, {kManual, kBusy}, {kTesting, Refusal::kDesign}}},
    {"stop", [](Supervisor& s) { return s.stop(); },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kFinished, kOk}, {kFinished, kOk}, {kFault, kOk}, {kDisarmed, kOk},
      {kDisarmed, kOk}}},
    {"acknowledge", [](Supervisor& s) { return s.acknowledge(); },
     {{kDisarmed, Refusal::kNoFault}, {kArmed, Refusal::kNoFault}, {kRunning, Refusal::kNoFault},
      {kFinished, Refusal::kNoFault}, {kDisarmed, kOk}, {kManual, Refusal::kNoFault}, {kTesting, Refusal::kNoFault}}},
    {"the host is heard", [](Supervisor& s) { return s.refresh_command(ms(50)); },
     {{kDisarmed, Refusal::kNotRunning}, {kArmed, kOk}, {kRunning, kOk}, {kFinished, Refusal::kNotRunning},
      {kFault, kLatched}, {kManual, kOk}, {kTesting, kOk}}},
    {"a fault is reported",
     [](Supervisor& s) {
       s.report(Fault::kBus);
       return kOk;
     },
     {{kFault, kOk}, {kFault, kOk}, {kFault, kOk}, {kFault, kOk}, {kFault, kOk}, {kFault, kOk}, {kFault, kOk}}},
    {"a tick without anything", [](Supervisor& s) { return tick(s, ms(100), kGoodV); },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kRunning, kOk}, {kFinished, kOk}, {kFault, kOk}, {kManual, kOk},
      {kTesting, kOk}}},
    {"the trial's time limit passes",
     [](Supervisor& s) {
       s.refresh_command(ms(9900));
       return tick(s, ms(10000), kGoodV);
     },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kFinished, kOk}, {kFinished, kOk}, {kFault, kOk}, {kManual, kOk},
      {kDisarmed, kOk}}},
    {"the test's time-out passes",
     [](Supervisor& s) {
       s.refresh_command(ms(2900));
       return tick(s, ms(3000), kGoodV);
     },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kRunning, kOk}, {kFinished, kOk}, {kFault, kOk}, {kManual, kOk},
      {kDisarmed, kOk}}},
    {"the host is silent", [](Supervisor& s) { return tick(s, ms(501), kGoodV); },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kFault, kOk}, {kFinished, kOk}, {kFault, kOk}, {kFault, kOk}, {kFault, kOk}}},
    {"the host is silent for 5 s", [](Supervisor& s) { return tick(s, ms(5001), kGoodV); },
     {{kDisarmed, kOk}, {kDisarmed, kOk}, {kFault, kOk}, {kFinished, kOk}, {kFault, kOk}, {kFault, kOk},
      {kDisarmed, kOk}}},
    {"the battery dips",
     [](Supervisor& s) {
       tick(s, ms(20), kLowV);
       s.refresh_command(ms(100));
       return tick(s, ms(499), kLowV);
     },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kRunning, kOk}, {kFinished, kOk}, {kFault, kOk}, {kManual, kOk},
      {kTesting, kOk}}},
    {"the battery stays low",
     [](Supervisor& s) {
       tick(s, ms(0), kLowV);
       return tick(s, ms(500), kLowV);
     },
     {{kDisarmed, kOk}, {kFault, kOk}, {kFault, kOk}, {kFinished, kOk}, {kFault, kOk}, {kFault, kOk}, {kFault, kOk}}},
    {"the battery becomes unreadable", [](Supervisor& s) { return tick(s, ms(20), NAN); },
     {{kDisarmed, kOk}, {kFault, kOk}, {kFault, kOk}, {kFinished, kOk}, {kFault, kOk}, {kFault, kOk}, {kFault, kOk}}},
    {"the IMU no longer answers", [](Supervisor& s) { return tick(s, ms(20), kGoodV, true); },
     {{kDisarmed, kOk}, {kFault, kOk}, {kFault, kOk}, {kFinished, kOk}, {kFault, kOk}, {kFault, kOk}, {kFault, kOk}}},
    {"a bump tilts the car",
     [](Supervisor& s) {
       tick(s, ms(20), kGoodV, false, kTooFarRad);
       return tick(s, ms(319), kGoodV, false, kTooFarRad);
     },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kRunning, kOk}, {kFinished, kOk}, {kFault, kOk}, {kManual, kOk},
      {kTesting, kOk}}},
    {"the car stays tilted",
     [](Supervisor& s) {
       tick(s, ms(20), kGoodV, false, kTooFarRad);
       return tick(s, ms(320), kGoodV, false, kTooFarRad);
     },
     {{kDisarmed, kOk}, {kArmed, kOk}, {kFault, kOk}, {kFinished, kOk}, {kFault, kOk}, {kFault, kOk},
      {kTesting, kOk}}},
};

Refusal answer(const TrialRequest& request, const Parameters& parameters = Parameters()) {
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV, 0);
  const Refusal refusal = supervisor.start(request, 0);
  TEST_ASSERT_TRUE(supervisor.pulses_enabled() == (refusal == Refusal::kNone));
  return refusal;
}

}  // namespace

void every_event_in_every_state_does_what_the_table_says() {
  const Parameters parameters;
  for (const Event& event : kTable) {
    for (const State from : {kDisarmed, kArmed, kRunning, kFinished, kFault, kManual, kTesting}) {
      Supervisor supervisor(parameters);
      bring_to(from, supervisor);
      char name[80];
      std::snprintf(name, sizeof name, "%s when %s", event.name, text(from));
      TEST_ASSERT_TRUE_MESSAGE(supervisor.state() == from, name);

      const Refusal refusal = event.happen(supervisor);

      const Expected& expected = event.expected[static_cast<std::size_t>(from)];
      TEST_ASSERT_EQUAL_STRING_MESSAGE(text(expected.state), text(supervisor.state()), name);
      TEST_ASSERT_EQUAL_STRING_MESSAGE(text(expected.refusal), text(refusal), name);
      const State now = supervisor.state();
      const bool drives = now == kRunning || now == kManual || now == kTesting;
      TEST_ASSERT_TRUE_MESSAGE(supervisor.pulses_enabled() == drives, name);
      TEST_ASSERT_TRUE_MESSAGE((supervisor.fault() != Fault::kNone) == (supervisor.state() == kFault), name);
    }
  }
}

void a_request_beyond_the_limits_is_refused_with_its_reason() {
  const float infinity = std::numeric_limits<float>::infinity();
  TEST_ASSERT_TRUE(answer({NAN, 0.0f, 1.0f, false, 0}) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer({0.1f, NAN, 1.0f, false, 0}) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, NAN, false, 0}) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer({5.0f, 100.0f, 1.0f, false, 0}) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer({-5.0f, -100.0f, 1.0f, false, 0}) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer({5.001f, 0.0f, 1.0f, false, 0}) == Refusal::kSpeedLimit);
  TEST_ASSERT_TRUE(answer({-infinity, 0.0f, 1.0f, false, 0}) == Refusal::kSpeedLimit);
  TEST_ASSERT_TRUE(answer({0.1f, -100.1f, 1.0f, false, 0}) == Refusal::kYawRateLimit);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, 0.0f, false, 0}) == Refusal::kTimeLimit);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, -1.0f, false, 0}) == Refusal::kTimeLimit);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, infinity, false, 0}) == Refusal::kTimeLimit);
}

void the_longest_trial_is_a_parameter() {
  Parameters parameters;
  parameters.set("TRIAL_MAX_S", 20.0f);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, 20.0f, false, 0}, parameters) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, 20.01f, false, 0}, parameters) == Refusal::kTimeLimit);
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

void refreshing_keeps_a_tethered_trial_alive() {
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

void an_armed_car_that_is_left_alone_disarms() {
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

void an_untethered_trial_needs_no_refresh() {
  const Parameters parameters;
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV, 0);
  supervisor.start(kUntethered, 0);
  tick(supervisor, ms(9999), kGoodV);
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
}

void a_battery_that_recovers_starts_the_count_anew() {
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

void a_minimum_of_zero_volts_allows_any_battery() {
  Parameters parameters;
  parameters.set("BATT_MIN_V", 0.0f);
  Supervisor supervisor(parameters);
  TEST_ASSERT_TRUE(supervisor.arm(0.0f, 0) == Refusal::kNone);
  supervisor.start(kUntethered, 0);
  tick(supervisor, ms(0), 0.0f);
  tick(supervisor, ms(5000), 0.0f);
  TEST_ASSERT_TRUE(supervisor.state() == kRunning);
}

void the_first_fault_stays_until_it_is_acknowledged() {
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

void how_a_trial_ended_is_kept_until_the_next_one_starts() {
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

void a_second_trial_counts_its_own_time() {
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

int main() {
  UNITY_BEGIN();
  RUN_TEST(every_event_in_every_state_does_what_the_table_says);
  RUN_TEST(a_request_beyond_the_limits_is_refused_with_its_reason);
  RUN_TEST(the_longest_trial_is_a_parameter);
  RUN_TEST(a_car_without_a_wheel_on_a_side_does_not_start);
  RUN_TEST(a_trial_ends_at_its_time_limit_and_not_before);
  RUN_TEST(refreshing_keeps_a_tethered_trial_alive);
  RUN_TEST(an_armed_car_that_is_left_alone_disarms);
  RUN_TEST(an_untethered_trial_needs_no_refresh);
  RUN_TEST(a_battery_that_recovers_starts_the_count_anew);
  RUN_TEST(a_minimum_of_zero_volts_allows_any_battery);
  RUN_TEST(the_first_fault_stays_until_it_is_acknowledged);
  RUN_TEST(how_a_trial_ended_is_kept_until_the_next_one_starts);
  RUN_TEST(a_second_trial_counts_its_own_time);
  return UNITY_END();
}
