#include "link.h"

#include <cstdlib>

namespace foldcar {
namespace {

// Reads of 128 bytes in one call: more than 115200 baud bring in a tick, and a bounded time.
constexpr int kMaxReads = 16;
// A damaged packet passes its checksum of 16 bits with a probability of 1/65536. Only a host that has sent another packet
// within this time (ms) before may set wheels in motion, so a single damaged packet never does.
constexpr std::uint32_t kKnownHostMs = 2000;

template <typename Content, typename Decode>
Content decoded(Decode decode, const mavlink_message_t& message) {
  Content content{};
  decode(&message, &content);
  return content;
}

bool is_for_car(std::uint8_t target_system, std::uint8_t target_component) {
  return (target_system == 0 || target_system == kCarSystem) &&
         (target_component == 0 || target_component == kCarComponent);
}

template <typename Content>
bool is_for_car(const Content& content) {
  return is_for_car(content.target_system, content.target_component);
}

}  // namespace

Link::Link(const Hal& hal, Application& application, const LoopStatistics& loop, const char* build)
    : hal_(hal), application_(application), loop_(loop), build_(build) {}

void Link::receive() {
  const std::uint64_t now_us = hal_.clock.now_us();
  mavlink_message_t message;
  while (parser_.next(message, now_us)) handle(message);
  for (int i = 0; i < kMaxReads; ++i) {
    std::uint8_t bytes[128];
    const std::size_t size = hal_.link.read(bytes, sizeof bytes);
    if (size == 0) return;
    for (std::size_t fed = 0; fed < size;) {
      fed += parser_.feed(bytes + fed, size - fed, now_us);
      while (parser_.next(message, now_us)) handle(message);
    }
  }
}

void Link::run() {
  const std::uint64_t now_us = hal_.clock.now_us();
  report_changes();
  parameters_.run();
  if (!application_.is_driving()) logs_.run();
  telemetry_.run(now_us, view(), outbox_);
  trial_log_.run(now_us, view());
}

void Link::handle(const mavlink_message_t& message) {
  const bool known_host = note_host(message.sysid);
  // Any packet of the host that drives shows that it is still there.
  if (application_.is_driving() && message.sysid == driver_system_) application_.refresh_command();
  switch (message.msgid) {
    case MAVLINK_MSG_ID_COMMAND_LONG: {
      const auto command = decoded<mavlink_command_long_t>(mavlink_msg_command_long_decode, message);
      if (is_for_car(command)) commands_.handle(command, message, known_host, view(), driver_system_);
      return;
    }
    case MAVLINK_MSG_ID_MANUAL_CONTROL: return drive_manually(message, known_host);
    case MAVLINK_MSG_ID_PARAM_REQUEST_LIST: {
      if (is_for_car(decoded<mavlink_param_request_list_t>(mavlink_msg_param_request_list_decode, message))) {
        parameters_.list();
      }
      return;
    }
    case MAVLINK_MSG_ID_PARAM_REQUEST_READ: {
      const auto request = decoded<mavlink_param_request_read_t>(mavlink_msg_param_request_read_decode, message);
      if (is_for_car(request)) parameters_.read(request);
      return;
    }
    case MAVLINK_MSG_ID_PARAM_SET: {
      const auto request = decoded<mavlink_param_set_t>(mavlink_msg_param_set_decode, message);
      if (is_for_car(request)) parameters_.set(request);
      return;
    }
    case MAVLINK_MSG_ID_TIMESYNC: return answer_timesync(message);
    case MAVLINK_MSG_ID_PING: return answer_ping(message);
    default: break;
  }
  if (application_.is_driving()) return;  // reading and erasing flash would delay the loop
  switch (message.msgid) {
    case MAVLINK_MSG_ID_LOG_REQUEST_LIST: {
      const auto request = decoded<mavlink_log_request_list_t>(mavlink_msg_log_request_list_decode, message);
      if (is_for_car(request)) logs_.list(request);
      return;
    }
    case MAVLINK_MSG_ID_LOG_REQUEST_DATA: {
      const auto request = decoded<mavlink_log_request_data_t>(mavlink_msg_log_request_data_decode, message);
      if (is_for_car(request)) logs_.data(request);
      return;
    }
    case MAVLINK_MSG_ID_LOG_ERASE:
      if (is_for_car(decoded<mavlink_log_erase_t>(mavlink_msg_log_erase_decode, message))) logs_.erase();
      return;
    case MAVLINK_MSG_ID_LOG_REQUEST_END:
      if (is_for_car(decoded<mavlink_log_request_end_t>(mavlink_msg_log_request_end_decode, message))) logs_.end();
      return;
    default: return;
  }
}

bool Link::note_host(std::uint8_t system) {
  const auto now_ms = static_cast<std::uint32_t>(hal_.clock.now_us() / 1000) | 1;
  const std::uint32_t before_ms = last_packet_ms_[system];
  last_packet_ms_[system] = now_ms;
  return before_ms != 0 && now_ms - before_ms <= kKnownHostMs;
}

void Link::drive_manually(const mavlink_message_t& message, bool known_host) {
  const auto stick = decoded<mavlink_manual_control_t>(mavlink_msg_manual_control_decode, message);
  if (stick.target != kCarSystem || !known_host) return;
  const auto axis = [](std::int16_t value) {
    return std::abs(value) <= 1000 ? 0.001f * static_cast<float>(value) : 0.0f;
  };
  const bool was_driving = application_.is_driving();
  application_.drive_manually(axis(stick.x), axis(stick.r));
  if (!was_driving && application_.is_driving()) driver_system_ = message.sysid;
}

void Link::answer_timesync(const mavlink_message_t& message) {
  const auto request = decoded<mavlink_timesync_t>(mavlink_msg_timesync_decode, message);
  if (request.tc1 != 0) return;
  mavlink_timesync_t answer{};
  answer.tc1 = static_cast<std::int64_t>(1000 * hal_.clock.now_us());
  answer.ts1 = request.ts1;
  outbox_.send(mavlink_msg_timesync_encode_status, answer, Priority::kAnswer);
}

void Link::answer_ping(const mavlink_message_t& message) {
  auto ping = decoded<mavlink_ping_t>(mavlink_msg_ping_decode, message);
  if (ping.target_system != 0 || ping.target_component != 0) return;
  ping.target_system = message.sysid;
  ping.target_component = message.compid;
  outbox_.send(mavlink_msg_ping_encode_status, ping, Priority::kAnswer);
}

void Link::report_changes() {
  const Fault fault = application_.status().fault;
  if (fault == reported_fault_) return;
  reported_fault_ = fault;
  if (fault == Fault::kNone) return status_text_.send(MAV_SEVERITY_NOTICE, "fault acknowledged");
  status_text_.send(MAV_SEVERITY_CRITICAL, "fault:", text(fault));
  if (fault == Fault::kDesign) status_text_.send(MAV_SEVERITY_ERROR, application_.design().problem);
}

CarView Link::view() const {
  const LinkStatistics link{parser_.packet_count(), parser_.bad_byte_count(), outbox_.unsent_count()};
  return {application_, hal_, loop_, link, build_};
}

}  // namespace foldcar
