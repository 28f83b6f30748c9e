#include "trial_log.h"

#include <array>
#include <cstdio>

#include "telemetry.h"

namespace foldcar {
namespace {

constexpr std::uint64_t kPeriodUs = 200000;
constexpr std::size_t kStampSize = 8;  // bytes of the time before each packet
constexpr std::size_t kLargestRecord = kStampSize + MAVLINK_MAX_PACKET_LEN;
// Bytes kept free for the two packets that tell how the trial ended.
constexpr std::size_t kReserve = 2 * kLargestRecord;

constexpr std::uint32_t kRecorded[] = {MAVLINK_MSG_ID_FOLDCAR_TRIAL, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
                                       MAVLINK_MSG_ID_SYS_STATUS, MAVLINK_MSG_ID_ATTITUDE, MAVLINK_MSG_ID_SCALED_IMU};

}  // namespace

void TrialLog::run(std::uint64_t now_us, const CarView& car) {
  const bool runs = car.application.status().state == State::kRunning && car.application.trial().untethered;
  if (runs && !is_recording_ && is_ready()) open(now_us, car);
  if (!is_recording_) return report();
  if (!runs) return close(car);
  if (now_us < next_us_) return;
  next_us_ += kPeriodUs;
  for (const std::uint32_t message_id : kRecorded) record(message_id, car, kReserve);
}

void TrialLog::open(std::uint64_t now_us, const CarView& car) {
  is_recording_ = writer_.begin();
  next_us_ = now_us;
  size_ = 0;
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

void TrialLog::record(std::uint32_t message_id, const CarView& car, std::size_t reserve) {
  mavlink_message_t message;
  if (!compose(message_id, car, numbers_, message)) return;
  std::array<std::uint8_t, kLargestRecord> bytes;
  const std::uint64_t now_us = car.hal.clock.now_us();
  for (std::size_t i = 0; i < kStampSize; ++i) {
    bytes[i] = static_cast<std::uint8_t>(now_us >> (8 * (kStampSize - 1 - i)));
  }
  const std::size_t size = kStampSize + mavlink_msg_to_send_buffer(bytes.data() + kStampSize, &message);
  if (size_ + size + reserve > kLargestLog || !writer_.put(bytes.data(), size, reserve)) return writer_.lose(size);
  size_ += size;
}

}  // namespace foldcar
