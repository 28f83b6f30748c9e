// The whole table of states and events.
#include "../suite.h"

#include <cmath>
#include <cstdio>
#include <functional>
#include <vector>

#include "supervisor_bench.h"

namespace foldcar {
namespace {

constexpr float kTooFarRad = 1.2f;

struct Expected {
  State state;
  Refusal refusal;
};

struct Event {
  const char* name;
  std::function<Refusal(Supervisor&)> happen;
  Expected expected[7];  // in the order of State
};

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

TEST(every_event_in_every_state_does_what_the_table_says) {
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

}  // namespace

}  // namespace foldcar
