// A supervisor with its parameters, and what the tests tell it.
#pragma once

#include <cstdint>

#include "supervisor.h"

namespace foldcar {

constexpr State kDisarmed = State::kDisarmed;
constexpr State kArmed = State::kArmed;
constexpr State kRunning = State::kRunning;
constexpr State kFinished = State::kFinished;
constexpr State kFault = State::kFault;
constexpr State kManual = State::kManual;
constexpr State kTesting = State::kTesting;

constexpr float kGoodV = 4.0f;
constexpr float kLowV = 3.0f;
constexpr TrialRequest kTrial{0.2f, 0.0f, 10.0f, false, 1};
constexpr TrialRequest kUntethered{0.2f, 0.0f, 10.0f, true, 2};

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
    supervisor.start(kTrial, 0);
    if (state == kFinished) supervisor.stop();
  }
  // The state after a tick at that time.
  State tick(std::uint64_t now_us, float battery_v = kGoodV, bool imu_lost = false, float tilt_rad = 0.0f) {
    supervisor.tick({now_us, battery_v, imu_lost, tilt_rad});
    return supervisor.state();
  }
};

}  // namespace foldcar
