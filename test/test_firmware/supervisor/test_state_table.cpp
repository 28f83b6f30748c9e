// The whole table of states and events.
#include "../../suite.h"

#include <cmath>
#include <cstdio>
#include <functional>
#include <vector>

#include "supervisor_bench.h"

using namespace foldcar;

namespace {

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
  Expected expected[7];  // in the order of State
};

constexpr Refusal kBusy = Refusal::kRunning, kLatched = Refusal::kFaultLatched, kLow = Refusal::kBatteryLow;
constexpr Refusal kUnreadable = Refusal::kBatteryUnreadable, kDesign = Refusal::kDesign, kNoDesign = Refusal::kNoDesign;
constexpr Refusal kNotArmed = Refusal::kNotArmed, kNotANumber = Refusal::kNotANumber, kTest = Refusal::kTest;
constexpr Refusal kNotDisarmed = Refusal::kNotDisarmed, kNoFault = Refusal::kNoFault, kNotRunning = Refusal::kNotRunning;

// A tick at that time; the host was heard at heard_ms, if at all.
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
    {"arm", [](Supervisor& s) { return s.arm(kGoodV, 0); }, {kArmed, kArmed, kBusy, kArmed, kLatched, kBusy, kBusy}},
    {"arm with a low battery", [](Supervisor& s) { return s.arm(kLowV, 0); },
     {kLow, kLow, kBusy, kLow, kLatched, kBusy, kBusy}},
    {"arm with an unreadable battery", [](Supervisor& s) { return s.arm(NAN, 0); },
     {kUnreadable, kUnreadable, kBusy, kUnreadable, kLatched, kBusy, kBusy}},
    {"arm with car.json refused", [](Supervisor& s) { return s.refuse_design(kDesign), s.arm(kGoodV, 0); },
     {kDesign, kDesign, kBusy, kDesign, kLatched, kBusy, kBusy}},
    {"arm without a car.json", [](Supervisor& s) { return s.refuse_design(kNoDesign), s.arm(kGoodV, 0); },
     {kNoDesign, kNoDesign, kBusy, kNoDesign, kLatched, kBusy, kBusy}},
    {"disarm", [](Supervisor& s) { return s.disarm(); },
     {kDisarmed, kDisarmed, kDisarmed, kDisarmed, kLatched, kDisarmed, kDisarmed}},
    {"start", [](Supervisor& s) { return s.start(kTrial, ms(50)); },
     {kNotArmed, kRunning, kBusy, kNotArmed, kLatched, kBusy, kBusy}},
    {"start with a bad request", [](Supervisor& s) { return s.start({NAN, 0.0f, 10.0f, false, 0}, ms(50)); },
     {kNotArmed, kNotANumber, kBusy, kNotArmed, kLatched, kBusy, kBusy}},
    {"the stick moves", [](Supervisor& s) { return s.drive_manually(true, ms(50)); },
     {kNotArmed, kManual, kBusy, kNotArmed, kLatched, kManual, kBusy}},
    {"the stick rests", [](Supervisor& s) { return s.drive_manually(false, ms(50)); },
     {kNotArmed, kArmed, kBusy, kNotArmed, kLatched, kManual, kBusy}},
    {"test an output", test(1.0f), {kTesting, kNotDisarmed, kBusy, kTesting, kLatched, kBusy, kTesting}},
    {"test an output for no time", test(0.0f), {kDisarmed, kNotDisarmed, kBusy, kDisarmed, kLatched, kBusy, kDisarmed}},
    {"test an output for too long", test(3.1f), {kTest, kNotDisarmed, kBusy, kTest, kLatched, kBusy, kTest}},
    {"test an output for no number of seconds", test(NAN), {kTest, kNotDisarmed, kBusy, kTest, kLatched, kBusy, kTest}},
    {"test an output with a low battery", test(1.0f, kLowV), {kLow, kNotDisarmed, kBusy, kLow, kLatched, kBusy, kLow}},
    {"test an output with car.json refused",
     [](Supervisor& s) { return s.refuse_design(kDesign), s.test(1.0f, kGoodV, ms(50)); },
     {kDesign, kNotDisarmed, kBusy, kDesign, kLatched, kBusy, kDesign}},
    {"stop", [](Supervisor& s) { return s.stop(); },
     {kDisarmed, kArmed, kFinished, kFinished, kFault, kDisarmed, kDisarmed}},
    {"acknowledge", [](Supervisor& s) { return s.acknowledge(); },
     {kNoFault, kNoFault, kNoFault, kNoFault, kDisarmed, kNoFault, kNoFault}},
    {"the host is heard", [](Supervisor& s) { return s.refresh_command(ms(50)); },
     {kNotRunning, kArmed, kRunning, kNotRunning, kLatched, kManual, kTesting}},
    {"a fault is reported", [](Supervisor& s) { return s.report(Fault::kBus), Refusal::kNone; },
     {kFault, kFault, kFault, kFault, kFault, kFault, kFault}},
    {"a tick without anything", tick(100), {kDisarmed, kArmed, kRunning, kFinished, kFault, kManual, kTesting}},
    {"the trial's time limit passes", tick(10000, kGoodV, false, 9900),
     {kDisarmed, kArmed, kFinished, kFinished, kFault, kManual, kDisarmed}},
    {"the test's time-out passes", tick(3000, kGoodV, false, 2900),
     {kDisarmed, kArmed, kRunning, kFinished, kFault, kManual, kDisarmed}},
    {"the host is silent", tick(501), {kDisarmed, kArmed, kFault, kFinished, kFault, kFault, kFault}},
    {"the host is silent for 5 s", tick(5001), {kDisarmed, kDisarmed, kFault, kFinished, kFault, kFault, kDisarmed}},
    {"the battery dips", ticks(20, 499, kLowV, 0, 100),
     {kDisarmed, kArmed, kRunning, kFinished, kFault, kManual, kTesting}},
    {"the battery stays low", ticks(0, 500, kLowV, 0), {kDisarmed, kFault, kFault, kFinished, kFault, kFault, kFault}},
    {"the battery becomes unreadable", tick(20, NAN), {kDisarmed, kFault, kFault, kFinished, kFault, kFault, kFault}},
    {"the IMU no longer answers", tick(20, kGoodV, true), {kDisarmed, kFault, kFault, kFinished, kFault, kFault, kFault}},
    {"a bump tilts the car", ticks(20, 319, kGoodV, 1.2f),
     {kDisarmed, kArmed, kRunning, kFinished, kFault, kManual, kTesting}},
    {"the car stays tilted", ticks(20, 320, kGoodV, 1.2f),
     {kDisarmed, kArmed, kFault, kFinished, kFault, kFault, kTesting}},
};

}  // namespace

TEST(every_event_in_every_state_does_what_the_table_says) {
  for (const Event& event : kTable) {
    for (const State from : {kDisarmed, kArmed, kRunning, kFinished, kFault, kManual, kTesting}) {
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
