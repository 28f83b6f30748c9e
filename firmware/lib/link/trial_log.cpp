#include "trial_log.h"

#include <cmath>
#include <cstdio>

#include "telemetry.h"

namespace foldcar {
namespace {

constexpr std::uint64_t kPeriodUs = 200000;
// The RAM for records has room for 180 s of them with an IMU that shakes (test_slow_flash.cpp). A trial that may last
// n times kWholeRateS is recorded at 1/n of the rate.
constexpr float kWholeRateS = 170.0f;
// Bytes kept free for the last two packets, the outputs and the trial's end.
constexpr std::size_t kReserve = 2 * kLargestPacked;
// Bytes of a record besides the packet's content: the time before the packet, and the packet's frame.
constexpr std::size_t kFrameSize = 8 + MAVLINK_NUM_NON_PAYLOAD_BYTES;

}  // namespace

// Records an untethered trial in RAM: opens the log at its start, records every period, closes it at its end.
void TrialLog::run(std::uint64_t now_us, const CarView& car) {
  const bool runs = car.application.status().state == State::kRunning && car.application.trial().untethered;
  if (runs && !is_recording_) open(now_us, car);
  if (!is_recording_) return report();
  if (!runs) return close(car);
  if (now_us < next_us_) return;
  next_us_ += period_us_;
  for (std::size_t i = 1; i < kLogged.size(); ++i) record(kLogged[i], car, kReserve);
}

void TrialLog::open(std::uint64_t now_us, const CarView& car) {
  is_recording_ = writer_.begin();
  if (!is_recording_) return;
  packer_.begin();
  next_us_ = now_us;
  period_us_ = kPeriodUs * static_cast<std::uint64_t>(std::ceil(car.application.trial().time_limit_s / kWholeRateS));
  record(kLogged.front(), car, kReserve);
}

void TrialLog::close(const CarView& car) {
  record(MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, car, 0);
  record(MAVLINK_MSG_ID_FOLDCAR_TRIAL, car, 0);
  writer_.finish();
  is_recording_ = false;
  is_unreported_ = true;
}

void TrialLog::report() {
  if (!is_unreported_ || !is_idle()) return;
  is_unreported_ = false;
  const LogStatus status = writer_.status();
  if (status.state != LogState::kIncomplete) return;
  char line[64];
  std::snprintf(line, sizeof line, "the trial's log lacks %lu bytes", static_cast<unsigned long>(status.lost_bytes));
  status_text_.send(MAV_SEVERITY_ERROR, line);
}

// Composes a message and adds it to the log, if `reserve` bytes stay free after it; else counts it as lost.
void TrialLog::record(std::uint32_t message_id, const CarView& car, std::size_t reserve) {
  mavlink_message_t message;
  if (!compose(message_id, car, numbers_, message)) return;
  const std::uint64_t now_us = car.hal.clock.now_us();
  const std::size_t size = kFrameSize + message.len;
  std::uint8_t packed[kLargestPacked];
  const std::size_t packed_size = packer_.pack(now_us, message, packed);
  if (!writer_.put(packed, packed_size, reserve)) return writer_.lose(size);
  packer_.keep(now_us, message);
}

}  // namespace foldcar
