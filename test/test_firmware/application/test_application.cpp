// The application over a recording HAL, ticked by hand: pulses in each state, the ramp over ticks early and late, parameters,
// many cars in one process; faults at the start (stored parameters, reset reason, design) and while it runs (servo driver,
// battery, IMU, tilt).
#include "../../suite.h"

#include <array>
#include <cmath>
#include <vector>

#include "../../recording_hal.h"
#include "application.h"

using namespace foldcar;

namespace {

constexpr TrialRequest kTrial{0.69f, 0.0f, 5.0f, true, 1};
constexpr PulsesUs kOff{};

struct ApplicationBench {
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
  void run_ticks(int count) {
    for (int i = 0; i < count; ++i) tick();
  }
  State state() const { return application.status().state; }
  Fault fault() const { return application.status().fault; }
  const PulsesUs& last_us() const { return board.servos.writes.back(); }
};

bool any_pulse(const PulsesUs& pulses_us) { return pulses_us != kOff; }

}  // namespace

TEST(pulses_come_only_while_a_trial_runs) {
  ApplicationBench bench;
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
  car.arm();
  car.start(kTrial);
  TEST_ASSERT_TRUE(pulses_after_tick());
  car.disarm();
  TEST_ASSERT_FALSE_MESSAGE(any_pulse(bench.last_us()), "disarming acts at once");
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

// A wheel that turns again while somebody holds another one would hurt.
TEST(a_test_of_an_output_drives_that_output_alone_whatever_was_tested_before) {
  ApplicationBench bench;
  bench.application.begin();
  const auto expect_only = [&bench](std::size_t channel, float pulse_us) {
    PulsesUs expected{};
    expected[channel] = pulse_us;
    bench.tick();
    TEST_ASSERT_TRUE(bench.last_us() == expected);
  };
  for (const bool stops_between : {false, true}) {
    for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
      const float pulse_us = 1600.0f + static_cast<float>(channel);
      TEST_ASSERT_TRUE(bench.application.test(channel, pulse_us, 1.0f) == Refusal::kNone);
      expect_only(channel, pulse_us);
      if (stops_between) bench.application.stop();
    }
    TEST_ASSERT_TRUE(bench.application.test(3, kNoPulse, 1.0f) == Refusal::kNone);
    expect_only(3, kNoPulse);
  }
  bench.application.stop();
  TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kNone);
  bench.application.start({0.0f, 0.0f, 5.0f, true, 1});
  bench.tick();
  TEST_ASSERT_EQUAL_FLOAT_MESSAGE(kNoPulse, bench.last_us()[7], "nor does a trial drive an output without a wheel");
}

TEST(the_first_tick_of_a_trial_is_neutral_and_the_ramp_follows_the_clock) {
  ApplicationBench bench;
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
  bench.tick(150000);
  TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.01f, 1545.0f + 0.5f * (elapsed_ms + 100.0f), bench.last_us()[0], "a gap is 0.1 s");
  bench.tick(6000000);
  TEST_ASSERT_TRUE_MESSAGE(bench.state() == State::kFinished, "nor does it lengthen the trial");
}

TEST(a_second_trial_starts_from_rest_like_the_first) {
  ApplicationBench bench;
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

TEST(a_parameter_that_is_set_is_saved_and_forgotten_on_request) {
  ApplicationBench bench;
  Application& car = bench.application;
  car.begin();
  TEST_ASSERT_TRUE(car.set_parameter(Parameter::kTrackM, 0.2f) == SetResult::kOk);
  TEST_ASSERT_TRUE(car.unsaved_parameter() == Parameter::kTrackM);
  TEST_ASSERT_TRUE(car.save_parameter(Parameter::kTrackM));
  TEST_ASSERT_EQUAL_FLOAT(0.2f, bench.board.storage.values["TRACK_M"]);
  TEST_ASSERT_TRUE(car.set_parameter(Parameter::kTrackM, -1.0f) == SetResult::kBelowMinimum);
  TEST_ASSERT_FALSE(car.unsaved_parameter().has_value());
  TEST_ASSERT_TRUE(car.set_parameter(Parameter::kTrackM, 0.3f) == SetResult::kOk);
  TEST_ASSERT_TRUE(car.reset_parameters());
  TEST_ASSERT_FALSE_MESSAGE(car.unsaved_parameter().has_value(), "would be saved after the reset");
  TEST_ASSERT_TRUE(bench.board.storage.values.empty());
  TEST_ASSERT_EQUAL_FLOAT(0.111f, bench.parameters.get(Parameter::kTrackM));
}

// Cars that are ticked in turn write exactly the pulses that each writes alone.
TEST(many_applications_do_not_influence_each_other) {
  const auto start = [](ApplicationBench& bench, float number) {
    bench.parameters.set("TRACK_M", 0.08f + 0.005f * number);
    bench.run({0.1f + 0.01f * number, 0.2f * number - 4.0f, 0.5f + 0.02f * number, true, 0});
  };
  std::array<ApplicationBench, 20> together;
  for (std::size_t i = 0; i < together.size(); ++i) start(together[i], static_cast<float>(i));
  for (int tick = 0; tick < 60; ++tick) {
    for (ApplicationBench& bench : together) bench.tick();
  }
  for (std::size_t i = 0; i < together.size(); ++i) {
    ApplicationBench alone;
    start(alone, static_cast<float>(i));
    alone.run_ticks(60);
    TEST_ASSERT_TRUE(alone.board.servos.writes == together[i].board.servos.writes);
  }
}

TEST(outputs_are_off_before_parameters_are_loaded) {
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
      {board.clock, board.servos, board.battery, board.servo_battery, board.link, storage, board.imu, board.logs,
       board.board},
      parameters);

  application.begin();

  TEST_ASSERT_TRUE(storage.off_came_first);
  TEST_ASSERT_EQUAL_FLOAT(0.25f, parameters.get(Parameter::kTrackM));
}

TEST(stored_parameters_that_cannot_be_read_are_a_fault) {
  ApplicationBench bench;
  bench.board.storage.values["STAGGER_MS"] = 77.0f;
  bench.board.storage.fitted = false;
  bench.application.begin();
  TEST_ASSERT_TRUE(bench.fault() == Fault::kFlash);
  TEST_ASSERT_TRUE(bench.application.acknowledge() == Refusal::kNone);
  TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kNone);
}

TEST(a_reset_by_a_watchdog_a_crash_or_a_brown_out_is_a_fault_of_its_own) {
  const auto fault_after = [](ResetReason reason) {
    ApplicationBench bench;
    bench.board.board.reason = reason;
    bench.application.begin();
    return bench.fault();
  };
  TEST_ASSERT_TRUE(fault_after(ResetReason::kPowerOn) == Fault::kNone);
  TEST_ASSERT_TRUE(fault_after(ResetReason::kSoftware) == Fault::kNone);
  TEST_ASSERT_TRUE(fault_after(ResetReason::kBrownOut) == Fault::kBrownOut);
  TEST_ASSERT_TRUE(fault_after(ResetReason::kCrash) == Fault::kCrash);
  TEST_ASSERT_TRUE(fault_after(ResetReason::kInterruptWatchdog) == Fault::kInterruptWatchdog);
  for (const ResetReason reason : {ResetReason::kTaskWatchdog, ResetReason::kOtherWatchdog}) {
    TEST_ASSERT_TRUE(fault_after(reason) == Fault::kWatchdog);
  }
}

// As the board reads its divider at the start, one that is set later measures nothing yet.
TEST(a_servo_battery_is_watched_on_a_car_that_measures_it) {
  ApplicationBench bench;
  bench.board.servo_battery.volts = 3.0f;
  bench.application.begin();
  TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kNone);
  bench.application.set_parameter(Parameter::kServoDivider, 3.0f);
  TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kNone);

  ApplicationBench measuring;
  measuring.board.storage.values["SERVO_DIVIDER"] = 3.0f;
  measuring.board.servo_battery.volts = 4.8f;
  measuring.run();
  measuring.board.servo_battery.volts = 3.0f;
  measuring.run_ticks(26);
  TEST_ASSERT_TRUE(measuring.fault() == Fault::kServoBatteryLow);
  TEST_ASSERT_TRUE(measuring.last_us() == kOff);
  measuring.application.acknowledge();
  TEST_ASSERT_TRUE(measuring.application.arm() == Refusal::kServoBatteryLow);
  TEST_ASSERT_TRUE(measuring.application.test(0, 1500.0f, 1.0f) == Refusal::kServoBatteryLow);
}

static DesignResult design_of(DesignSource source) {
  DesignResult design;
  design.source = source;
  return design;
}

TEST(a_refused_design_keeps_the_car_from_moving_even_when_acknowledged) {
  ApplicationBench bench;
  bench.application.begin(design_of(DesignSource::kRefused));
  TEST_ASSERT_TRUE(bench.fault() == Fault::kDesign);
  TEST_ASSERT_TRUE(bench.application.acknowledge() == Refusal::kNone);
  TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kDesign);
  TEST_ASSERT_TRUE(bench.application.test(0, 1500.0f, 1.0f) == Refusal::kDesign);
}

TEST(a_car_without_a_design_stays_disarmed_until_that_is_confirmed) {
  for (const DesignSource source : {DesignSource::kMissing, DesignSource::kUnreadable}) {
    ApplicationBench bench;
    bench.board.board.reason = ResetReason::kBrownOut;
    bench.application.begin(design_of(source));
    const Fault fault = source == DesignSource::kMissing ? Fault::kNoDesign : Fault::kFlash;
    TEST_ASSERT_TRUE(bench.fault() == Fault::kBrownOut);
    TEST_ASSERT_TRUE_MESSAGE(bench.application.acknowledge() == Refusal::kNone, "hides no missing design");
    TEST_ASSERT_TRUE(bench.fault() == fault);
    TEST_ASSERT_TRUE(bench.application.acknowledge() == Refusal::kNoDesign);
    TEST_ASSERT_TRUE(bench.fault() == fault);
    TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kFaultLatched);
    TEST_ASSERT_TRUE(bench.application.acknowledge(true) == Refusal::kNone);
    TEST_ASSERT_TRUE(bench.application.design().source == DesignSource::kNone);
    TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kNone);
  }
}

TEST(each_fault_of_the_start_is_reported_when_the_one_before_is_acknowledged) {
  ApplicationBench bench;
  bench.board.board.reason = ResetReason::kTaskWatchdog;
  bench.board.storage.values["TRACK_M"] = -1.0f;
  bench.application.begin(design_of(DesignSource::kRefused));
  for (const Fault fault : {Fault::kWatchdog, Fault::kDesign, Fault::kStoredParameter}) {
    TEST_ASSERT_TRUE(bench.fault() == fault);
    TEST_ASSERT_TRUE(bench.application.acknowledge() == Refusal::kNone);
  }
  TEST_ASSERT_TRUE(bench.fault() == Fault::kNone);
  TEST_ASSERT_TRUE(bench.application.arm() == Refusal::kDesign);
}

TEST(a_driver_or_an_imu_that_stops_answering_stops_the_car_with_an_off_write) {
  for (const Fault fault : {Fault::kBus, Fault::kImu}) {
    ApplicationBench bench;
    bench.board.fit_imu();
    bench.run();
    bench.tick();
    (fault == Fault::kBus ? bench.board.servos.answers : bench.board.imu.answers) = false;
    bench.tick();
    TEST_ASSERT_TRUE(bench.fault() == fault);
    TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
    TEST_ASSERT_FALSE(any_pulse(bench.application.status().pulses_us));
  }
}

TEST(a_bus_fault_comes_back_until_the_driver_answers) {
  ApplicationBench bench;
  bench.board.servos.answers = false;
  bench.application.begin();
  TEST_ASSERT_TRUE(bench.fault() == Fault::kBus);
  bench.application.acknowledge();
  bench.tick();
  TEST_ASSERT_TRUE(bench.state() == State::kFault);
  bench.board.servos.answers = true;
  bench.application.acknowledge();
  bench.tick();
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
}

TEST(a_short_dip_of_the_battery_does_not_end_a_trial_and_a_long_one_does) {
  ApplicationBench bench;
  bench.run();
  const auto low_for = [&bench](int tick_count) {
    bench.board.battery.volts = 3.0f;
    bench.run_ticks(tick_count);
    bench.board.battery.volts = 4.0f;
    bench.tick();
    return bench.fault();
  };
  TEST_ASSERT_TRUE(low_for(25) == Fault::kNone);  // 480 ms from the first to the last low reading
  TEST_ASSERT_TRUE(low_for(26) == Fault::kBatteryLow);
}

TEST(a_car_that_lies_on_its_side_stops_if_it_has_an_imu) {
  ApplicationBench bench;
  bench.board.fit_imu();
  bench.run();
  bench.run_ticks(10);
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
  bench.board.imu.now.acceleration_m_s2 = {0.0f, 9.81f, 0.0f};
  int ticks = 0;
  for (; ticks < 200 && bench.application.is_driving(); ++ticks) bench.tick();
  TEST_ASSERT_TRUE(bench.fault() == Fault::kTilt);
  TEST_ASSERT_FALSE(any_pulse(bench.last_us()));
  // Gravity turns the estimate with a time constant of 0.5 s; then 0.3 s must pass.
  TEST_ASSERT_TRUE(ticks > 15 && ticks < 80);
}
