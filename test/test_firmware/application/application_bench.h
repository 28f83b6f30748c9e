// The application over a recording HAL, ticked by hand.
#pragma once

#include <unity.h>

#include "../../recording_hal.h"
#include "application.h"

namespace foldcar {

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

inline bool any_pulse(const PulsesUs& pulses_us) { return pulses_us != kOff; }

}  // namespace foldcar
