// The start of a trial: the car comes to rest, then the firmware is armed and receives the set-point.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>

#include "application.h"
#include "trial.h"

namespace foldcar {

// Time between putting the car down (it falls a little) and the start of the trial.
constexpr double kSettling_s = 0.25;
// A charged lithium cell, which the firmware's low-voltage guard reads; the servos have their own supply.
constexpr double kLogicBattery_v = 4.0;

// Seconds to whole microseconds.
inline std::uint64_t to_us(double t_s) { return static_cast<std::uint64_t>(std::llround(t_s * 1e6)); }

// TrialError if the firmware has refused.
inline void expect_accepted(Refusal refusal) {
  if (refusal != Refusal::kNone) throw TrialError(std::string("the firmware refused: ") + text(refusal));
}

// Arms the firmware and starts it. TrialError if it refuses.
inline void start_firmware(Application& application, const TrialSpec& trial) {
  TrialRequest request;
  request.speed_m_s = static_cast<float>(trial.speed_m_s);
  request.yaw_rate_rad_s = static_cast<float>(trial.yaw_rate_rad_s);
  request.time_limit_s = static_cast<float>(trial.time_limit_s);
  request.untethered = true;
  expect_accepted(application.arm());
  expect_accepted(application.start(request));
}

}  // namespace foldcar
