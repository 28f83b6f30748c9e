#include "trial_log.h"

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
  if (runs && !is_open_ && storage_.present()) {
    open(car);
    next_us_ = now_us;
  }
  if (!is_open_) return;
  if (!runs) return close(car);
  if (now_us < next_us_) return;
  next_us_ += kPeriodUs;
  for (const std::uint32_t message_id : kRecorded) {
    if (size_ + kReserve + kLargestRecord <= kLargestLog) record(message_id, car);
  }
}

void TrialLog::open(const CarView& car) {
  std::uint16_t first = 1, last = 0;
  storage_.range(first, last);
  const auto id = static_cast<std::uint16_t>(last + 1);
  for (; first + kLogsKept <= id; ++first) storage_.remove(first);
  is_open_ = true;
  failed_ = !storage_.create(id);
  size_ = buffered_ = 0;
  record(MAVLINK_MSG_ID_FOLDCAR_DESIGN, car);
}

void TrialLog::close(const CarView& car) {
  record(MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, car);
  record(MAVLINK_MSG_ID_FOLDCAR_TRIAL, car);
  append_buffer();
  failed_ = !storage_.close() || failed_;
  is_open_ = false;
  if (failed_) status_text_.send(MAV_SEVERITY_ERROR, "the trial's log could not be stored");
}

void TrialLog::record(std::uint32_t message_id, const CarView& car) {
  mavlink_message_t message;
  if (!compose(message_id, car, numbers_, message)) return;
  if (buffered_ + kLargestRecord > buffer_.size()) append_buffer();
  const std::size_t before = buffered_;
  const std::uint64_t now_us = car.hal.clock.now_us();
  for (std::size_t i = 0; i < kStampSize; ++i) {
    buffer_[buffered_++] = static_cast<std::uint8_t>(now_us >> (8 * (kStampSize - 1 - i)));
  }
  buffered_ += mavlink_msg_to_send_buffer(buffer_.data() + buffered_, &message);
  size_ += buffered_ - before;
}

void TrialLog::append_buffer() {
  failed_ = failed_ || !storage_.append(buffer_.data(), buffered_);
  buffered_ = 0;
}

}  // namespace foldcar
