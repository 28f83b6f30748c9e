// The application's tick and console over a recording HAL: order, pulses by state, bus faults, many cars.
#include <unity.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "../hal_contract.h"
#include "../recording_hal.h"
#include "application.h"
#include "console.h"

using namespace foldcar;

void setUp() {}
void tearDown() {}

namespace {

constexpr TrialRequest kTrial{0.69f, 0.0f, 5.0f, true};
constexpr PulsesUs kOff{};

struct Bench {
  RecordingHal board;
  Parameters parameters;
  Application application{board.hal(), parameters};

  void tick(std::uint64_t step_us = kTickUs) {
    board.clock.time_us += step_us;
    application.tick();
  }
  void run(const TrialRequest& request = kTrial) {
    application.begin();
    TEST_ASSERT_TRUE(application.arm() == Refusal::kNone);
    TEST_ASSERT_TRUE(application.start(request) == Refusal::kNone);
  }
  const PulsesUs& last_us() const { return board.servos.writes.back(); }
};

bool any_pulse(const PulsesUs& pulses_us) { return pulses_us != kOff; }

}  // namespace

void the_recording_hal_keeps_the_contract() {
  RecordingHal board;
  check_hal_contract(board.hal(), [&board] { board.clock.time_us += 10; });
}

void outputs_are_off_before_parameters_are_loaded() {
  struct WatchingStorage : RecordingStorage {
    const RecordingServos* servos = nullptr;
    bool off_came_first = true;
    bool load(const char* name, float& value) override {
      off_came_first = off_came_first && servos->writes.size() == 1 && servos->writes[0] == kOff;
      return RecordingStorage::load(name, value);
    }
  };
  RecordingHal board;
  WatchingStorage storage;
  storage.servos = &board.servos;
  storage.values["TRACK_M"] = 0.25f;
  Parameters parameters;
  Application application({board.clock, board.servos, board.battery, board.link, storage}, parameters);

  application.begin();

  TEST_ASSERT_TRUE(storage.off_came_first);
  TEST_ASSERT_EQUAL_FLOAT(0.25f, parameters.get(Parameter::kTrackM));
}

void a_stored_parameter_out_of_range_is_a_fault() {
  Bench bench;
  bench.board.storage.values["TRACK_M"] = 99.0f;
  bench.application.begin();
  TEST_ASSERT_TRUE(bench.application.status().fault == Fault::kStoredParameter);
  TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kFaultLatched);
}

void pulses_come_only_while_a_trial_runs() {
  Bench bench;
  Application& car = bench.application;
  const auto pulses_after_tick = [&bench] {
    bench.tick();
    return any_pulse(bench.last_us());
  };
  car.begin();
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "disarmed");
  car.arm();
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "armed");
  car.start(kTrial);
  TEST_ASSERT_TRUE_MESSAGE(pulses_after_tick(), "running");
  car.stop();
  TEST_ASSERT_FALSE_MESSAGE(any_pulse(bench.last_us()), "stop acts at once");
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "finished");
  car.arm();
  car.start(kTrial);
  TEST_ASSERT_TRUE_MESSAGE(pulses_after_tick(), "running again");
  bench.board.battery.volts = NAN;
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "fault");
  bench.board.battery.volts = 4.0f;
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "the fault is latched");
  car.acknowledge();
  TEST_ASSERT_FALSE_MESSAGE(pulses_after_tick(), "acknowledged");
  car.arm();
  car.start(kTrial);
  car.disarm();
  TEST_ASSERT_FALSE_MESSAGE(any_pulse(bench.last_us()), "disarm acts at once");
}

void the_first_tick_of_a_trial_is_neutral_and_the_ramp_follows_the_clock() {
  Bench bench;
  bench.parameters.set("SLEW_US_PER_S", 500.0f);
  bench.parameters.set("STAGGER_MS", 0.0f);
  bench.run();
  bench.tick(0);
  TEST_ASSERT_TRUE(bench.last_us()[0] == 1500.0f);
  // Ticks that come early and late; 0.5 us of pulse a millisecond beyond the deadband of 45 us.
  float elapsed_ms = 0.0f;
  for (const float step_ms : {20.0f, 13.0f, 31.0f, 20.0f, 1.0f}) {
    bench.tick(static_cast<std::uint64_t>(1000.0f * step_ms));
    elapsed_ms += step_ms;
    TEST_ASSERT_FLOAT_WITHIN(0.01f, 1545.0f + 0.5f * elapsed_ms, bench.last_us()[0]);
  }
}

void a_second_trial_starts_from_rest_like_the_first() {
  Bench bench;
  bench.run();
  std::vector<PulsesUs> first_us;
  for (int i = 0; i < 20; ++i) {
    bench.tick();
    first_us.push_back(bench.last_us());
  }
  bench.application.stop();
  bench.tick(700000);
  bench.application.arm();
  bench.application.start(kTrial);
  for (const PulsesUs& pulses_us : first_us) {
    bench.tick();
    TEST_ASSERT_TRUE(bench.last_us() == pulses_us);
  }
}

void after_a_long_gap_the_ramp_does_not_jump() {
  Bench bench;
  bench.parameters.set("SLEW_US_PER_S", 500.0f);
  bench.parameters.set("STAGGER_MS", 0.0f);
  bench.run();
  bench.tick(2000000);
  TEST_ASSERT_FLOAT_WITHIN(0.01f, 1545.0f + 500.0f * 0.1f, bench.last_us()[0]);
}

void a_late_tick_does_not_lengthen_the_trial() {
  Bench bench;
  bench.run({0.1f, 0.0f, 1.0f, true});
  bench.tick(1500000);
  TEST_ASSERT_TRUE(bench.application.status().state == State::kFinished);
  TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
}

void a_write_that_fails_is_a_bus_fault_and_is_followed_by_an_off_write() {
  Bench bench;
  bench.run();
  bench.tick();
  bench.board.servos.answers = false;
  bench.tick();
  TEST_ASSERT_TRUE(bench.application.status().fault == Fault::kBus);
  TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
  TEST_ASSERT_FALSE(any_pulse(bench.application.status().pulses_us));
}

void a_bus_fault_comes_back_until_the_driver_answers() {
  Bench bench;
  bench.board.servos.answers = false;
  bench.application.begin();
  TEST_ASSERT_TRUE(bench.application.status().fault == Fault::kBus);
  bench.application.acknowledge();
  bench.tick();
  TEST_ASSERT_TRUE(bench.application.status().state == State::kFault);
  bench.board.servos.answers = true;
  bench.application.acknowledge();
  bench.tick();
  TEST_ASSERT_TRUE(bench.application.status().state == State::kDisarmed);
}

void a_short_dip_of_the_battery_does_not_end_a_trial_and_a_long_one_does() {
  Bench bench;
  bench.run();
  const auto low_for = [&bench](int tick_count) {
    bench.board.battery.volts = 3.0f;
    for (int i = 0; i < tick_count; ++i) bench.tick();
    bench.board.battery.volts = 4.0f;
    bench.tick();
    return bench.application.status().fault;
  };
  TEST_ASSERT_TRUE(low_for(25) == Fault::kNone);  // 480 ms from the first to the last low reading
  TEST_ASSERT_TRUE(low_for(26) == Fault::kBatteryLow);
}

void parameters_changed_in_a_trial_drive_the_next_one() {
  Bench bench;
  bench.run();
  for (int i = 0; i < 50; ++i) bench.tick();
  bench.parameters.set("CH1_NEUTRAL_US", 1450.0f);
  bench.tick();
  TEST_ASSERT_FLOAT_WITHIN(0.01f, 1700.0f, bench.last_us()[0]);
  bench.application.stop();
  bench.application.arm();
  bench.application.start(kTrial);
  for (int i = 0; i < 50; ++i) bench.tick();
  TEST_ASSERT_FLOAT_WITHIN(0.01f, 1650.0f, bench.last_us()[0]);
}

void status_tells_the_state_the_time_and_the_pulses() {
  Bench bench;
  bench.run();
  for (int i = 0; i < 10; ++i) bench.tick();
  const Status status = bench.application.status();
  TEST_ASSERT_TRUE(status.state == State::kRunning);
  TEST_ASSERT_EQUAL_UINT64(200000, status.trial_elapsed_us);
  TEST_ASSERT_EQUAL_FLOAT(4.0f, status.battery_v);
  TEST_ASSERT_TRUE(status.pulses_us == bench.last_us());
}

// Each car alone, then all of them tick by tick in turn: the pulses are the same bits.
void many_applications_do_not_influence_each_other() {
  constexpr std::size_t kCarCount = 40;
  const auto make = [](std::size_t number) {
    auto bench = std::make_unique<Bench>();
    const float n = static_cast<float>(number);
    bench->parameters.set("TRACK_M", 0.08f + 0.005f * n);
    bench->parameters.set("STAGGER_MS", 3.0f * n);
    bench->run({0.1f + 0.01f * n, 0.2f * n - 4.0f, 0.5f + 0.02f * n, true});
    return bench;
  };
  std::vector<std::unique_ptr<Bench>> together;
  for (std::size_t number = 0; number < kCarCount; ++number) together.push_back(make(number));
  for (int i = 0; i < 60; ++i) {
    for (auto& bench : together) bench->tick();
  }
  for (std::size_t number = 0; number < kCarCount; ++number) {
    const auto alone = make(number);
    for (int i = 0; i < 60; ++i) alone->tick();
    TEST_ASSERT_TRUE(alone->board.servos.writes == together[number]->board.servos.writes);
    TEST_ASSERT_EQUAL_UINT(1 + 60, alone->board.servos.writes.size());  // begin and the ticks
  }
}

void the_console_prints_one_line_a_second_and_obeys_letters() {
  Bench bench;
  Console console(bench.application, bench.board.link);
  bench.application.begin();
  std::string& text = bench.board.link.outgoing;
  for (int i = 0; i < 150; ++i) {
    bench.tick();
    console.poll(bench.board.clock.time_us);
  }
  const std::string line = "disarmed, fault: none, trial 0 ms, battery 4000 mV, last command: ok\r\n";
  TEST_ASSERT_TRUE(text == line + line + line);

  const auto state_after = [&](const char* letters) {
    bench.board.link.incoming = letters;
    console.poll(bench.board.clock.time_us);
    return bench.application.status().state;
  };
  TEST_ASSERT_TRUE(state_after("g\r\n") == State::kDisarmed);
  TEST_ASSERT_TRUE(state_after("a") == State::kArmed);
  TEST_ASSERT_TRUE(state_after("g") == State::kRunning);
  TEST_ASSERT_TRUE(state_after("s") == State::kFinished);
  TEST_ASSERT_TRUE(state_after("d") == State::kDisarmed);
  bench.board.servos.answers = false;
  bench.tick();
  bench.board.servos.answers = true;
  TEST_ASSERT_TRUE(state_after("a") == State::kFault);
  TEST_ASSERT_TRUE(state_after("c") == State::kDisarmed);
}

void a_slow_link_gets_whole_lines_without_anyone_waiting() {
  Bench bench;
  Console console(bench.application, bench.board.link);
  bench.application.begin();
  bench.board.battery.volts = NAN;
  bench.board.link.room = 3;
  for (int i = 0; i < 49; ++i) {
    bench.tick();
    console.poll(bench.board.clock.time_us);
  }
  TEST_ASSERT_EQUAL_STRING("disarmed, fault: none, trial 0 ms, battery -1 mV, last command: ok\r\n",
                           bench.board.link.outgoing.c_str());
}

int main() {
  UNITY_BEGIN();
  RUN_TEST(the_recording_hal_keeps_the_contract);
  RUN_TEST(outputs_are_off_before_parameters_are_loaded);
  RUN_TEST(a_stored_parameter_out_of_range_is_a_fault);
  RUN_TEST(pulses_come_only_while_a_trial_runs);
  RUN_TEST(the_first_tick_of_a_trial_is_neutral_and_the_ramp_follows_the_clock);
  RUN_TEST(a_second_trial_starts_from_rest_like_the_first);
  RUN_TEST(after_a_long_gap_the_ramp_does_not_jump);
  RUN_TEST(a_late_tick_does_not_lengthen_the_trial);
  RUN_TEST(a_write_that_fails_is_a_bus_fault_and_is_followed_by_an_off_write);
  RUN_TEST(a_bus_fault_comes_back_until_the_driver_answers);
  RUN_TEST(a_short_dip_of_the_battery_does_not_end_a_trial_and_a_long_one_does);
  RUN_TEST(parameters_changed_in_a_trial_drive_the_next_one);
  RUN_TEST(status_tells_the_state_the_time_and_the_pulses);
  RUN_TEST(many_applications_do_not_influence_each_other);
  RUN_TEST(the_console_prints_one_line_a_second_and_obeys_letters);
  RUN_TEST(a_slow_link_gets_whole_lines_without_anyone_waiting);
  UNITY_END();
  return 0;
}
