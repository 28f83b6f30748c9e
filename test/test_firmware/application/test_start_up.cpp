// What the application does first: outputs off, stored parameters, reset reason, design.
#include "../../suite.h"

#include "application_bench.h"

using namespace foldcar;

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
      {board.clock, board.servos, board.battery, board.link, storage, board.imu, board.logs, board.board}, parameters);

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

TEST(a_reset_by_a_watchdog_or_a_brown_out_is_a_fault) {
  const auto fault_after = [](ResetReason reason) {
    ApplicationBench bench;
    bench.board.board.reason = reason;
    bench.application.begin();
    return bench.fault();
  };
  TEST_ASSERT_TRUE(fault_after(ResetReason::kPowerOn) == Fault::kNone);
  TEST_ASSERT_TRUE(fault_after(ResetReason::kSoftware) == Fault::kNone);
  TEST_ASSERT_TRUE(fault_after(ResetReason::kBrownOut) == Fault::kBrownOut);
  for (const ResetReason reason : {ResetReason::kCrash, ResetReason::kInterruptWatchdog, ResetReason::kTaskWatchdog,
                                   ResetReason::kOtherWatchdog}) {
    TEST_ASSERT_TRUE(fault_after(reason) == Fault::kWatchdog);
  }
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
