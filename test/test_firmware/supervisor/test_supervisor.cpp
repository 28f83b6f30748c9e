// The supervisor: the whole table of states and events, what time ends, faults that are latched, requests that are refused.
#include "../../suite.h"

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <limits>
#include <vector>

#include "supervisor.h"

using namespace foldcar;

namespace {

constexpr State kDisarmed = State::kDisarmed;
constexpr State kArmed = State::kArmed;
constexpr State kRunning = State::kRunning;
constexpr State kFinished = State::kFinished;
constexpr State kFault = State::kFault;
constexpr State kManual = State::kManual;
constexpr State kTesting = State::kTesting;
constexpr State kCounting = State::kCounting;

constexpr float kGoodV = 4.0f;
constexpr float kLowV = 3.0f;
constexpr TrialRequest kTrial{0.2f, 0.0f, 10.0f, false, 1};
constexpr TrialRequest kUntethered{0.2f, 0.0f, 10.0f, true, 2};
constexpr TrialRequest kDelayed{0.2f, 0.0f, 10.0f, false, 3, 5.0f};
constexpr TrialRequest kDelayedUntethered{0.2f, 0.0f, 10.0f, true, 4, 8.0f};
constexpr TrialRequest kByButton{0.2f, 0.0f, 10.0f, true, 5, 8.0f, true};

constexpr std::uint64_t ms(std::uint64_t time_ms) { return 1000 * time_ms; }

struct SupervisorBench {
  Parameters parameters;
  Supervisor supervisor{parameters};

  // A trial that has started, if the request is accepted.
  Refusal start(const TrialRequest& request, std::uint64_t now_us = 0) {
    supervisor.arm(kGoodV, now_us);
    return supervisor.start(request, now_us);
  }
  // Brings a new supervisor into a state, by accepted requests at time 0.
  void bring_to(State state) {
    if (state == kDisarmed) return;
    if (state == kTesting) return static_cast<void>(supervisor.test(3.0f, kGoodV, 0));
    supervisor.arm(kGoodV, 0);
    if (state == kArmed) return;
    if (state == kFault) return supervisor.report(Fault::kBus);
    if (state == kManual) return static_cast<void>(supervisor.drive_manually(true, 0));
    supervisor.start(state == kCounting ? kDelayed : kTrial, 0);
    if (state == kFinished) supervisor.stop();
  }
  // The state after a tick at that time.
  State tick(std::uint64_t now_us, float battery_v = kGoodV, bool imu_lost = false, float tilt_rad = 0.0f) {
    supervisor.tick({now_us, battery_v, imu_lost, tilt_rad});
    return supervisor.state();
  }
};

using Happening = std::function<Refusal(Supervisor&)>;

// The state that an event leads to, or the refusal that leaves the state as it is.
struct Expected {
  State state;
  Refusal refusal;
  Expected(State next) : state(next), refusal(Refusal::kNone) {}
  Expected(Refusal why) : state(), refusal(why) {}
};

struct Event {
  const char* name;
  Happening happen;
  Expected expected[8];  // in the order of State
};

constexpr Refusal kBusy = Refusal::kRunning, kLatched = Refusal::kFaultLatched, kLow = Refusal::kBatteryLow;
constexpr Refusal kUnreadable = Refusal::kBatteryUnreadable, kDesign = Refusal::kDesign, kNoDesign = Refusal::kNoDesign;
constexpr Refusal kNotArmed = Refusal::kNotArmed, kNotANumber = Refusal::kNotANumber, kTest = Refusal::kTest;
constexpr Refusal kNotDisarmed = Refusal::kNotDisarmed, kNoFault = Refusal::kNoFault, kNotRunning = Refusal::kNotRunning;

// A tick at that time; the host was heard at heard_ms, if at all, which does not count in manual driving.
Happening tick(std::uint64_t time_ms, float battery_v = kGoodV, bool imu_lost = false, std::uint64_t heard_ms = 0) {
  return [=](Supervisor& s) {
    if (heard_ms > 0) s.refresh_command(ms(heard_ms));
    return s.tick({ms(time_ms), battery_v, imu_lost, 0.0f}), Refusal::kNone;
  };
}

// Two ticks with the same low battery or tilt.
Happening ticks(std::uint64_t first_ms, std::uint64_t second_ms, float battery_v, float tilt_rad,
                std::uint64_t heard_ms = 0) {
  return [=](Supervisor& s) {
    s.tick({ms(first_ms), battery_v, false, tilt_rad});
    if (heard_ms > 0) s.refresh_command(ms(heard_ms));
    return s.tick({ms(second_ms), battery_v, false, tilt_rad}), Refusal::kNone;
  };
}

Happening test(float time_s, float battery_v = kGoodV) {
  return [=](Supervisor& s) { return s.test(time_s, battery_v, ms(50)); };
}

// docs/firmware.md has this table too.
const std::vector<Event> kTable = {
    {"arm", [](Supervisor& s) { return s.arm(kGoodV, 0); }, {kArmed, kArmed, kBusy, kArmed, kLatched, kBusy, kBusy, kBusy}},
    {"arm with a low battery", [](Supervisor& s) { return s.arm(kLowV, 0); },
     {kLow, kLow, kBusy, kLow, kLatched, kBusy, kBusy, kBusy}},
    {"arm with an unreadable battery", [](Supervisor& s) { return s.arm(NAN, 0); },
     {kUnreadable, kUnreadable, kBusy, kUnreadable, kLatched, kBusy, kBusy, kBusy}},
    {"arm with car.json refused", [](Supervisor& s) { return s.refuse_design(kDesign), s.arm(kGoodV, 0); },
     {kDesign, kDesign, kBusy, kDesign, kLatched, kBusy, kBusy, kBusy}},
    {"arm without a car.json", [](Supervisor& s) { return s.refuse_design(kNoDesign), s.arm(kGoodV, 0); },
     {kNoDesign, kNoDesign, kBusy, kNoDesign, kLatched, kBusy, kBusy, kBusy}},
    {"disarm", [](Supervisor& s) { return s.disarm(); },
     {kDisarmed, kDisarmed, kDisarmed, kDisarmed, kLatched, kDisarmed, kDisarmed, kDisarmed}},
    {"start", [](Supervisor& s) { return s.start(kTrial, ms(50)); },
     {kNotArmed, kRunning, kBusy, kNotArmed, kLatched, kBusy, kBusy, kBusy}},
    {"start with a bad request", [](Supervisor& s) { return s.start({NAN, 0.0f, 10.0f, false, 0}, ms(50)); },
     {kNotArmed, kNotANumber, kBusy, kNotArmed, kLatched, kBusy, kBusy, kBusy}},
    {"the stick moves", [](Supervisor& s) { return s.drive_manually(true, ms(50)); },
     {kNotArmed, kManual, kBusy, kNotArmed, kLatched, kManual, kBusy, kBusy}},
    {"the stick rests", [](Supervisor& s) { return s.drive_manually(false, ms(50)); },
     {kNotArmed, kArmed, kBusy, kNotArmed, kLatched, kManual, kBusy, kBusy}},
    {"test an output", test(1.0f), {kTesting, kNotDisarmed, kBusy, kTesting, kLatched, kBusy, kTesting, kBusy}},
    {"test an output for no time", test(0.0f), {kDisarmed, kNotDisarmed, kBusy, kDisarmed, kLatched, kBusy, kDisarmed, kBusy}},
    {"test an output for too long", test(3.1f), {kTest, kNotDisarmed, kBusy, kTest, kLatched, kBusy, kTest, kBusy}},
    {"test an output for no number of seconds", test(NAN), {kTest, kNotDisarmed, kBusy, kTest, kLatched, kBusy, kTest, kBusy}},
    {"test an output with a low battery", test(1.0f, kLowV), {kLow, kNotDisarmed, kBusy, kLow, kLatched, kBusy, kLow, kBusy}},
    {"test an output with car.json refused",
     [](Supervisor& s) { return s.refuse_design(kDesign), s.test(1.0f, kGoodV, ms(50)); },
     {kDesign, kNotDisarmed, kBusy, kDesign, kLatched, kBusy, kDesign, kBusy}},
    {"stop", [](Supervisor& s) { return s.stop(); },
     {kDisarmed, kArmed, kFinished, kFinished, kFault, kDisarmed, kDisarmed, kFinished}},
    {"acknowledge", [](Supervisor& s) { return s.acknowledge(); },
     {kNoFault, kNoFault, kNoFault, kNoFault, kDisarmed, kNoFault, kNoFault, kNoFault}},
    {"the host is heard", [](Supervisor& s) { return s.refresh_command(ms(50)); },
     {kNotRunning, kArmed, kRunning, kNotRunning, kLatched, kNotRunning, kTesting, kCounting}},
    {"a fault is reported", [](Supervisor& s) { return s.report(Fault::kBus), Refusal::kNone; },
     {kFault, kFault, kFault, kFault, kFault, kFault, kFault, kFault}},
    {"a tick without anything", tick(100), {kDisarmed, kArmed, kRunning, kFinished, kFault, kManual, kTesting, kCounting}},
    {"the trial's time limit passes", tick(10000, kGoodV, false, 9900),
     {kDisarmed, kArmed, kFinished, kFinished, kFault, kFault, kDisarmed, kRunning}},
    {"the test's time-out passes", tick(3000, kGoodV, false, 2900),
     {kDisarmed, kArmed, kRunning, kFinished, kFault, kFault, kDisarmed, kCounting}},
    {"the host is silent", tick(501), {kDisarmed, kArmed, kFault, kFinished, kFault, kFault, kFault, kFault}},
    {"the host is silent for 5 s", tick(5001), {kDisarmed, kDisarmed, kFault, kFinished, kFault, kFault, kDisarmed, kFault}},
    {"the battery dips", ticks(20, 449, kLowV, 0, 100),
     {kDisarmed, kArmed, kRunning, kFinished, kFault, kManual, kTesting, kCounting}},
    {"the battery stays low", ticks(0, 500, kLowV, 0), {kDisarmed, kFault, kFault, kFinished, kFault, kFault, kFault, kFault}},
    {"the battery becomes unreadable", tick(20, NAN), {kDisarmed, kFault, kFault, kFinished, kFault, kFault, kFault, kFault}},
    {"the IMU no longer answers", tick(20, kGoodV, true), {kDisarmed, kFault, kFault, kFinished, kFault, kFault, kFault, kFault}},
    {"a bump tilts the car", ticks(20, 319, kGoodV, 1.2f),
     {kDisarmed, kArmed, kRunning, kFinished, kFault, kManual, kTesting, kCounting}},
    {"the car stays tilted", ticks(20, 320, kGoodV, 1.2f),
     {kDisarmed, kArmed, kFault, kFinished, kFault, kFault, kTesting, kCounting}},
};

}  // namespace

TEST(every_event_in_every_state_does_what_the_table_says) {
  for (const Event& event : kTable) {
    for (const State from : {kDisarmed, kArmed, kRunning, kFinished, kFault, kManual, kTesting, kCounting}) {
      SupervisorBench bench;
      const Supervisor& supervisor = bench.supervisor;
      bench.bring_to(from);
      char name[80];
      std::snprintf(name, sizeof name, "%s when %s", event.name, text(from));
      TEST_ASSERT_TRUE_MESSAGE(supervisor.state() == from, name);

      const Refusal refusal = event.happen(bench.supervisor);

      const Expected& expected = event.expected[static_cast<std::size_t>(from)];
      const State now = supervisor.state();
      TEST_ASSERT_EQUAL_STRING_MESSAGE(text(expected.refusal), text(refusal), name);
      TEST_ASSERT_EQUAL_STRING_MESSAGE(text(refusal == Refusal::kNone ? expected.state : from), text(now), name);
      const bool drives = now == kRunning || now == kManual || now == kTesting;
      TEST_ASSERT_TRUE_MESSAGE(supervisor.pulses_enabled() == drives, name);
      TEST_ASSERT_TRUE_MESSAGE((supervisor.fault() != Fault::kNone) == (now == kFault), name);
    }
  }
}

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

// 4 cells at 0.9 V.
TEST(a_servo_battery_that_is_measured_ends_driving_when_it_stays_below_its_minimum) {
  for (const float servos_v : {3.59f, 0.0f, NAN}) {
    for (const State state : {kArmed, kRunning, kManual, kTesting, kCounting}) {
      SupervisorBench bench;
      bench.bring_to(state);
      bench.supervisor.tick({ms(20), {kGoodV, servos_v}, false, 0.0f});
      bench.supervisor.tick({ms(400), {kGoodV, 3.61f}, false, 0.0f});
      bench.supervisor.refresh_command(ms(420));
      bench.supervisor.drive_manually(true, ms(420));
      bench.supervisor.tick({ms(420), {kGoodV, servos_v}, false, 0.0f});
      bench.supervisor.tick({ms(860), {kGoodV, servos_v}, false, 0.0f});
      TEST_ASSERT_TRUE_MESSAGE(bench.supervisor.fault() == Fault::kNone, "the starting servos' dip is short");
      bench.supervisor.refresh_command(ms(900));
      bench.supervisor.drive_manually(true, ms(900));
      bench.supervisor.tick({ms(920), {kGoodV, servos_v}, false, 0.0f});
      TEST_ASSERT_TRUE(bench.supervisor.fault() == Fault::kServoBatteryLow);
    }
    SupervisorBench bench;
    TEST_ASSERT_TRUE(bench.supervisor.arm({kGoodV, servos_v}, 0) == Refusal::kServoBatteryLow);
    TEST_ASSERT_TRUE(bench.supervisor.test(1.0f, {kGoodV, servos_v}, 0) == Refusal::kServoBatteryLow);
    bench.parameters.set("SERVO_MIN_V", 0.0f);
    TEST_ASSERT_TRUE(bench.supervisor.arm({kGoodV, servos_v}, 0) == Refusal::kNone);
    bench.supervisor.start(kUntethered, 0);
    for (const std::uint64_t t_ms : {20, 5000}) bench.supervisor.tick({ms(t_ms), {kGoodV, servos_v}, false, 0.0f});
    TEST_ASSERT_TRUE_MESSAGE(bench.supervisor.state() == kRunning, "0 allows any");
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

TEST(a_delayed_trial_counts_first_and_its_time_limit_counts_from_the_first_pulse) {
  SupervisorBench bench;
  TEST_ASSERT_TRUE(bench.start(kDelayedUntethered) == Refusal::kNone);
  TEST_ASSERT_TRUE(bench.supervisor.state() == kCounting);
  TEST_ASSERT_TRUE(bench.supervisor.is_driving());
  TEST_ASSERT_FALSE(bench.supervisor.pulses_enabled());
  TEST_ASSERT_EQUAL_UINT64(ms(8000), bench.supervisor.countdown_us());
  TEST_ASSERT_TRUE(bench.tick(ms(5000)) == kCounting);  // without a host
  TEST_ASSERT_EQUAL_UINT64(ms(3000), bench.supervisor.countdown_us());
  TEST_ASSERT_TRUE(bench.tick(ms(7999)) == kCounting);
  TEST_ASSERT_TRUE(bench.tick(ms(8000)) == kRunning);
  TEST_ASSERT_EQUAL_UINT64(0, bench.supervisor.countdown_us());
  TEST_ASSERT_TRUE(bench.tick(ms(17999)) == kRunning);
  TEST_ASSERT_EQUAL_UINT64(ms(9999), bench.supervisor.trial_elapsed_us());
  TEST_ASSERT_TRUE(bench.tick(ms(18000)) == kFinished);
  for (const float delay_s : {-1.0f, 61.0f}) {
    TEST_ASSERT_TRUE(SupervisorBench().start({0.2f, 0.0f, 10.0f, false, 1, delay_s}) == Refusal::kDelay);
  }
  TEST_ASSERT_TRUE(SupervisorBench().start({0.2f, 0.0f, 10.0f, false, 1, NAN}) == Refusal::kNotANumber);
}

// It is put down after the command; only then is it to stand level.
TEST(a_car_that_is_carried_may_tilt_but_does_not_drive_so) {
  SupervisorBench bench;
  bench.start(kDelayedUntethered);
  for (std::uint64_t t_ms = 0; t_ms < 8000; t_ms += 20) {
    TEST_ASSERT_TRUE(bench.tick(ms(t_ms), kGoodV, false, 1.2f) == kCounting);
  }
  TEST_ASSERT_TRUE(bench.tick(ms(8000), kGoodV, false, 1.2f) == kFault);
}

TEST(the_button_starts_the_count_of_a_trial_that_waits_for_it_and_stops_what_drives) {
  SupervisorBench bench;
  Supervisor& car = bench.supervisor;
  car.arm(kGoodV, 0);
  car.press_button(ms(10));
  TEST_ASSERT_TRUE_MESSAGE(car.state() == kArmed, "no trial waits");
  TEST_ASSERT_TRUE(car.start(kByButton, ms(20)) == Refusal::kNone);
  TEST_ASSERT_TRUE(bench.tick(ms(60000)) == kArmed);
  car.press_button(ms(60000));
  TEST_ASSERT_TRUE(car.state() == kCounting);
  TEST_ASSERT_TRUE(bench.tick(ms(67999)) == kCounting);
  TEST_ASSERT_TRUE(bench.tick(ms(68000)) == kRunning);
  car.press_button(ms(69000));
  TEST_ASSERT_TRUE(car.state() == kFinished);
  TEST_ASSERT_TRUE(car.trial_end() == TrialEnd::kStopped);
  car.press_button(ms(69500));
  TEST_ASSERT_TRUE(car.state() == kFinished);
  for (const State state : {kManual, kTesting, kCounting}) {
    SupervisorBench other;
    other.bring_to(state);
    other.supervisor.press_button(ms(50));
    TEST_ASSERT_FALSE(other.supervisor.is_driving());
  }
}

TEST(a_trial_that_waits_for_the_button_ends_with_a_stop_a_disarm_and_after_TRIAL_MAX_S) {
  for (const bool disarms : {false, true}) {
    SupervisorBench bench;
    bench.start(kByButton);
    if (disarms) bench.supervisor.disarm();
    if (!disarms) bench.supervisor.stop();
    bench.supervisor.press_button(ms(100));
    TEST_ASSERT_FALSE(bench.supervisor.is_driving());
    TEST_ASSERT_TRUE(bench.supervisor.trial_end() != TrialEnd::kNone);
  }
  SupervisorBench bench;
  bench.start(kByButton);
  TEST_ASSERT_TRUE(bench.tick(ms(600000)) == kArmed);
  TEST_ASSERT_TRUE(bench.tick(ms(600001)) == kDisarmed);
}
