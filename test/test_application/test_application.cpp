// The application's tick over a recording HAL: order of writes, pulses in each state, faults, many cars in one process.
#include <unity.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "../hal_contract.h"
#include "../recording_hal.h"
#include "application.h"

using namespace foldcar;

void setUp() {}
void tearDown() {}

namespace {

constexpr TrialRequest kTrial{0.69f, 0.0f, 5.0f, true, 1};
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
  for (const bool with_imu : {false, true}) {
    RecordingHal board;
    board.imu.fitted = with_imu;
    check_hal_contract(board.hal(), [&board] { board.clock.time_us += 10; });
  }
}

void outputs_are_off_before_parameters_are_loaded() {
  struct WatchingStorage : SimStorage {
    const RecordingServos* servos = nullptr;
    bool off_came_first = true;
    bool load(const char* name, float& value) override {
      off_came_first = off_came_first && servos->writes.size() == 1 && servos->writes[0] == kOff;
      return SimStorage::load(name, value);
    }
  };
  RecordingHal board;
  WatchingStorage storage;
  storage.servos = &board.servos;
  storage.values["TRACK_M"] = 0.25f;
  Parameters parameters;
  Application application(
      {board.clock, board.servos, board.battery, board.link, storage, board.imu, board.logs, board.board}, parameters);

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
  bench.run({0.1f, 0.0f, 1.0f, true, 0});
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

// Cars that are ticked in turn write exactly the pulses that each writes alone.
void many_applications_do_not_influence_each_other() {
  constexpr std::size_t kCarCount = 40;
  const auto make = [](std::size_t number) {
    auto bench = std::make_unique<Bench>();
    const float n = static_cast<float>(number);
    bench->parameters.set("TRACK_M", 0.08f + 0.005f * n);
    bench->parameters.set("STAGGER_MS", 3.0f * n);
    bench->run({0.1f + 0.01f * n, 0.2f * n - 4.0f, 0.5f + 0.02f * n, true, 0});
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

void a_reset_by_a_watchdog_or_a_brown_out_is_a_fault() {
  const auto fault_after = [](ResetReason reason) {
    Bench bench;
    bench.board.board.reason = reason;
    bench.application.begin();
    return bench.application.status().fault;
  };
  TEST_ASSERT_TRUE(fault_after(ResetReason::kPowerOn) == Fault::kNone);
  TEST_ASSERT_TRUE(fault_after(ResetReason::kSoftware) == Fault::kNone);
  TEST_ASSERT_TRUE(fault_after(ResetReason::kBrownOut) == Fault::kBrownOut);
  for (const ResetReason reason : {ResetReason::kCrash, ResetReason::kInterruptWatchdog, ResetReason::kTaskWatchdog,
                                   ResetReason::kOtherWatchdog}) {
    TEST_ASSERT_TRUE(fault_after(reason) == Fault::kWatchdog);
  }
}

void a_refused_design_keeps_the_car_from_moving_even_when_acknowledged() {
  Bench bench;
  DesignResult design;
  design.source = DesignSource::kRefused;
  bench.application.begin(design);
  TEST_ASSERT_TRUE(bench.application.status().fault == Fault::kDesign);
  TEST_ASSERT_TRUE(bench.application.acknowledge() == Refusal::kNone);
  TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kDesign);
  TEST_ASSERT_TRUE(bench.application.test(0, 1500.0f, 1.0f) == Refusal::kDesign);
}

void a_car_without_a_design_stays_disarmed_until_that_is_confirmed() {
  for (const DesignSource source : {DesignSource::kMissing, DesignSource::kUnreadable}) {
    Bench bench;
    DesignResult design;
    design.source = source;
    bench.application.begin(design);
    const Fault fault = source == DesignSource::kMissing ? Fault::kNoDesign : Fault::kFlash;
    TEST_ASSERT_TRUE(bench.application.status().fault == fault);
    TEST_ASSERT_TRUE(bench.application.acknowledge() == Refusal::kNoDesign);
    TEST_ASSERT_TRUE(bench.application.status().fault == fault);
    TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kFaultLatched);
    TEST_ASSERT_TRUE(bench.application.acknowledge(true) == Refusal::kNone);
    TEST_ASSERT_TRUE(bench.application.design().source == DesignSource::kNone);
    TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kNone);
  }
}

void another_fault_does_not_hide_that_there_is_no_design() {
  Bench bench;
  bench.board.board.reason = ResetReason::kBrownOut;
  DesignResult design;
  design.source = DesignSource::kMissing;
  bench.application.begin(design);
  TEST_ASSERT_TRUE(bench.application.status().fault == Fault::kBrownOut);
  TEST_ASSERT_TRUE(bench.application.acknowledge() == Refusal::kNone);
  TEST_ASSERT_TRUE(bench.application.status().fault == Fault::kNoDesign);
  TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kFaultLatched);
}

void stored_parameters_that_cannot_be_read_are_a_fault() {
  Bench bench;
  bench.board.storage.values["STAGGER_MS"] = 77.0f;
  bench.board.storage.fitted = false;
  bench.application.begin();
  TEST_ASSERT_TRUE(bench.application.status().fault == Fault::kFlash);
  TEST_ASSERT_TRUE(bench.application.acknowledge() == Refusal::kNone);
  TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kNone);
}

void a_car_that_lies_on_its_side_stops_if_it_has_an_imu() {
  Bench bench;
  bench.board.imu.fitted = true;
  bench.board.imu.now.acceleration_m_s2 = {0.0f, 0.0f, 9.81f};
  bench.run();
  for (int i = 0; i < 10; ++i) bench.tick();
  TEST_ASSERT_TRUE(bench.application.status().state == State::kRunning);
  bench.board.imu.now.acceleration_m_s2 = {0.0f, 9.81f, 0.0f};
  int ticks = 0;
  for (; ticks < 200 && bench.application.is_driving(); ++ticks) bench.tick();
  TEST_ASSERT_TRUE(bench.application.status().fault == Fault::kTilt);
  TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
  // Gravity turns the estimate with a time constant of 0.5 s; then 0.3 s must pass.
  TEST_ASSERT_TRUE(ticks > 15 && ticks < 80);
}

void an_imu_that_stops_answering_stops_the_car() {
  Bench bench;
  bench.board.imu.fitted = true;
  bench.board.imu.now.acceleration_m_s2 = {0.0f, 0.0f, 9.81f};
  bench.run();
  bench.tick();
  bench.board.imu.answers = false;
  bench.tick();
  TEST_ASSERT_TRUE(bench.application.status().fault == Fault::kImu);
  TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
}

// Full forward stick is WHEEL_MAX_RAD_S: 1500 + 45 + 155 us forward at the default gain, mirrored on the right.
void the_stick_drives_an_armed_car() {
  Bench bench;
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
  TEST_ASSERT_TRUE(bench.application.status().state == State::kManual);
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1700.0f, bench.last_us()[0]);
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1300.0f, bench.last_us()[1]);
  for (int i = 0; i < 50; ++i) {
    bench.application.drive_manually(0.0f, 1.0f);
    bench.tick();
  }
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1300.0f, bench.last_us()[0]);  // left wheels backward, right ones forward
  TEST_ASSERT_FLOAT_WITHIN(0.1f, 1300.0f, bench.last_us()[1]);
  for (int i = 0; i < 26; ++i) bench.tick();
  TEST_ASSERT_TRUE(bench.application.status().fault == Fault::kCommandStale);
  TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
  TEST_ASSERT_TRUE(bench.application.drive_manually(NAN, 0.0f) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(bench.application.drive_manually(1.1f, 0.0f) == Refusal::kNotANumber);
}

void a_test_puts_its_pulse_on_one_output_only_and_ends() {
  Bench bench;
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
  TEST_ASSERT_TRUE(bench.application.status().state == State::kDisarmed);
  TEST_ASSERT_TRUE(bench.application.test(8, 1500.0f, 0.2f) == Refusal::kTest);
  TEST_ASSERT_TRUE(bench.application.test(0, 999.0f, 0.2f) == Refusal::kTest);
  TEST_ASSERT_TRUE(bench.application.test(0, 2001.0f, 0.2f) == Refusal::kTest);
  TEST_ASSERT_TRUE(bench.application.test(0, NAN, 0.2f) == Refusal::kTest);
}

void a_parameter_that_is_set_is_saved_and_forgotten_on_request() {
  Bench bench;
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
  RUN_TEST(a_reset_by_a_watchdog_or_a_brown_out_is_a_fault);
  RUN_TEST(a_refused_design_keeps_the_car_from_moving_even_when_acknowledged);
  RUN_TEST(a_car_without_a_design_stays_disarmed_until_that_is_confirmed);
  RUN_TEST(another_fault_does_not_hide_that_there_is_no_design);
  RUN_TEST(stored_parameters_that_cannot_be_read_are_a_fault);
  RUN_TEST(a_car_that_lies_on_its_side_stops_if_it_has_an_imu);
  RUN_TEST(an_imu_that_stops_answering_stops_the_car);
  RUN_TEST(the_stick_drives_an_armed_car);
  RUN_TEST(a_test_puts_its_pulse_on_one_output_only_and_ends);
  RUN_TEST(a_parameter_that_is_set_is_saved_and_forgotten_on_request);
  return UNITY_END();
}
