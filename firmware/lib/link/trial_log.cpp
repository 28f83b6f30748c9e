#include "trial_log.h"

#include <array>
#include <cmath>
#include <cstdio>

#include "telemetry.h"

namespace foldcar {
namespace {

constexpr std::uint64_t kPeriodUs = 200000;
// A log has room for 130 s of records with an IMU that shakes (test_slow_flash.cpp). A trial that may last n times
// kFullRateLimitS is recorded at 1/n of the rate.
constexpr float kFullRateLimitS = 130.0f;
// The messages of a log: first the car's design, then these, again and again.
constexpr std::array<std::uint32_t, 6> kRepeated = {MAVLINK_MSG_ID_FOLDCAR_TRIAL, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
                                                    MAVLINK_MSG_ID_SYS_STATUS,    MAVLINK_MSG_ID_ATTITUDE,
                                                    MAVLINK_MSG_ID_SCALED_IMU,    MAVLINK_MSG_ID_BATTERY_STATUS};
// A record: the time (µs, 8 bytes, the highest first), then the packet.
constexpr std::size_t kStampSize = 8;
constexpr std::size_t kLargestRecord = kStampSize + MAVLINK_MAX_PACKET_LEN;
// Bytes kept free for the two packets that tell how the trial ended.
constexpr std::size_t kReserve = 2 * (kStampSize + MAVLINK_NUM_NON_PAYLOAD_BYTES) + MAVLINK_MSG_ID_SERVO_OUTPUT_RAW_LEN +
                                 MAVLINK_MSG_ID_FOLDCAR_TRIAL_LEN;

}  // namespace

// Records an untethered trial: opens the log at its start, records every period, closes it at its end.
void TrialLog::run(std::uint64_t now_us, const CarView& car) {
  const bool runs = car.application.status().state == State::kRunning && car.application.trial().untethered;
  if (runs && !is_recording_) open(now_us, car);
  if (!is_recording_) return report();
  if (!runs) return close(car);
  if (now_us < next_us_) return;
  next_us_ += period_us_;
  for (const std::uint32_t message_id : kRepeated) record(message_id, car, kReserve);
}

void TrialLog::open(std::uint64_t now_us, const CarView& car) {
  is_recording_ = writer_.begin();
  if (!is_recording_) return;
  numbers_ = {};
  next_us_ = now_us;
  period_us_ = kPeriodUs * static_cast<std::uint64_t>(std::ceil(car.application.trial().time_limit_s / kFullRateLimitS));
  record(MAVLINK_MSG_ID_FOLDCAR_DESIGN, car, kReserve);
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
  std::uint8_t bytes[kLargestRecord];
  for (std::size_t i = 0; i < kStampSize; ++i) bytes[i] = static_cast<std::uint8_t>(now_us >> (8 * (kStampSize - 1 - i)));
  const std::size_t size = kStampSize + mavlink_msg_to_send_buffer(bytes + kStampSize, &message);
  if (!writer_.put(bytes, size, reserve)) writer_.lose(size);
}

}  // namespace foldcar
