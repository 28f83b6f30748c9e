#include "link.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace foldcar {
namespace {

// Most packets handled, and reads of 128 bytes made, in one call, so that a burst cannot keep the tick waiting. The
// board's loop comes round every millisecond or two: this is more than 115200 baud bring in that time.
constexpr int kMaxPackets = 4;
constexpr int kMaxReads = 16;
// A damaged packet passes its checksum of 16 bits with a probability of 1/65536. Only a host that has sent another
// packet within this time (ms) before may set wheels in motion, so a single damaged packet never does.
constexpr std::uint32_t kKnownHostMs = 2000;
constexpr std::uint64_t kComplaintUs = 5000000;

// Returns the message's content, read by MAVLink's generated function `decode`.
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

// Whether any of the eight channels is overridden; 0 and 65535 mean that a channel is not.
bool overrides(const mavlink_rc_channels_override_t& sticks) {
  for (const std::uint16_t value : {sticks.chan1_raw, sticks.chan2_raw, sticks.chan3_raw, sticks.chan4_raw,
                                    sticks.chan5_raw, sticks.chan6_raw, sticks.chan7_raw, sticks.chan8_raw}) {
    if (value != 0 && value != UINT16_MAX) return true;
  }
  return false;
}

}  // namespace

Link::Link(const Hal& hal, Application& application, const LoopStatistics& loop, const char* build)
    : hal_(hal), application_(application), loop_(loop), build_(build) {}

// Reads and handles the packets that have arrived. late: they waited while the loop stood still; they are all handled,
// but only those that stop the car are obeyed.
void Link::receive(bool late) {
  const std::uint64_t now_us = hal_.clock.now_us();
  int packets = 0;
  // What is late is handled completely, so that none of it counts as new at the next call.
  for (int reads = 0; late || reads < kMaxReads; ++reads) {
    mavlink_message_t message;
    while ((late || packets < kMaxPackets) && parser_.next(message, now_us)) {
      handle(message, late);
      ++packets;
    }
    if (!late && packets == kMaxPackets) return;
    std::uint8_t bytes[128];
    static_assert(sizeof bytes <= MAVLINK_MAX_PACKET_LEN, "they fit behind an incomplete packet");
    const std::size_t size = hal_.link.read(bytes, sizeof bytes);
    if (size == 0) return;
    parser_.feed(bytes, size, now_us);
  }
}

void Link::discard() {
  std::uint8_t bytes[128];
  while (hal_.link.read(bytes, sizeof bytes) > 0) {
  }
}

// The link's work of one tick: reports, parameters and logs (flash is used only while the wheels stand), telemetry.
void Link::run() {
  const std::uint64_t now_us = hal_.clock.now_us();
  report_changes();
  const bool may_use_flash = !application_.is_driving() && trial_log_.is_idle();
  parameters_.run(may_use_flash);
  if (may_use_flash) logs_.run();
  telemetry_.run(now_us, view(), outbox_);
  trial_log_.run(now_us, view());
}

// Handles one packet, by its message. Unknown messages are ignored, as MAVLink wants.
void Link::handle(const mavlink_message_t& message, bool late) {
  if (message.magic == MAVLINK_STX_MAVLINK1) return complain("MAVLink 1: set the host to MAVLink 2");
  if (late) return handle_late(message);
  const Host host{message.sysid, message.compid};
  const Sender sender{host, note_host(host.system), false};
  // Any packet of the host that armed or drives shows that it is still there; in manual driving only its stick does.
  if (!is_controlled_by_other(sender)) application_.refresh_command();
  switch (message.msgid) {
    case MAVLINK_MSG_ID_COMMAND_LONG: {
      const auto command = decoded<mavlink_command_long_t>(mavlink_msg_command_long_decode, message);
      if (is_for_car(command)) commands_.handle(command, sender, view(), controlling_host_);
      return;
    }
    case MAVLINK_MSG_ID_MANUAL_CONTROL: return drive_manually(message, sender);
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
    case MAVLINK_MSG_ID_PARAM_SET: return set_parameter(message, sender);
    case MAVLINK_MSG_ID_MISSION_REQUEST_LIST: return answer_mission_list(message);
    case MAVLINK_MSG_ID_TIMESYNC: return answer_timesync(message);
    case MAVLINK_MSG_ID_PING: return answer_ping(message);
    case MAVLINK_MSG_ID_COMMAND_INT:
    case MAVLINK_MSG_ID_SET_MODE:
    case MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE: return refuse_stations_controls(message, sender);
    case MAVLINK_MSG_ID_LOG_REQUEST_LIST:
    case MAVLINK_MSG_ID_LOG_REQUEST_DATA:
    case MAVLINK_MSG_ID_LOG_ERASE:
    case MAVLINK_MSG_ID_LOG_REQUEST_END: return handle_log_request(message, sender);
    default: return;
  }
}

// Answers a packet that waited: settings and commands are refused as late, except commands that stop the car.
void Link::handle_late(const mavlink_message_t& message) {
  const Sender sender{{message.sysid, message.compid}, false, true};
  if (message.msgid == MAVLINK_MSG_ID_PARAM_SET) return set_parameter(message, sender);
  if (message.msgid != MAVLINK_MSG_ID_COMMAND_LONG) return;
  const auto command = decoded<mavlink_command_long_t>(mavlink_msg_command_long_decode, message);
  if (is_for_car(command)) commands_.handle(command, sender, view(), controlling_host_);
}

void Link::handle_log_request(const mavlink_message_t& message, const Sender& sender) {
  // Reading and erasing flash would delay the loop. This protocol has no answer that refuses.
  const bool ends = message.msgid == MAVLINK_MSG_ID_LOG_REQUEST_END;
  if (!ends && application_.is_driving()) return complain("logs are not read or erased while wheels are driven");
  if (!ends && !trial_log_.is_idle()) return complain(text(Refusal::kStoring));
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
      if (!is_for_car(decoded<mavlink_log_erase_t>(mavlink_msg_log_erase_decode, message))) return;
      if (is_controlled_by_other(sender)) return complain(HeldBy(controlling_host_).text);
      return logs_.erase();
    case MAVLINK_MSG_ID_LOG_REQUEST_END:
      if (is_for_car(decoded<mavlink_log_request_end_t>(mavlink_msg_log_request_end_decode, message))) logs_.end();
      return;
    default: return;
  }
}

// Sets a parameter, or refuses that if the packet is late or another host controls the car.
void Link::set_parameter(const mavlink_message_t& message, const Sender& sender) {
  const auto request = decoded<mavlink_param_set_t>(mavlink_msg_param_set_decode, message);
  if (!is_for_car(request)) return;
  if (sender.late) return parameters_.refuse(request, Refusal::kLate, text(Refusal::kLate));
  if (is_controlled_by_other(sender)) return parameters_.refuse(request, Refusal::kHeld, HeldBy(controlling_host_).text);
  parameters_.set(request);
}

// Refuses what ground stations send to vehicles with missions, modes and a radio control: COMMAND_INT, SET_MODE and
// RC_CHANNELS_OVERRIDE.
void Link::refuse_stations_controls(const mavlink_message_t& message, const Sender& sender) {
  switch (message.msgid) {
    case MAVLINK_MSG_ID_COMMAND_INT: {
      const auto command = decoded<mavlink_command_int_t>(mavlink_msg_command_int_decode, message);
      if (is_for_car(command)) commands_.refuse(command.command, sender.host, MAV_RESULT_COMMAND_LONG_ONLY);
      return;
    }
    case MAVLINK_MSG_ID_SET_MODE:
      // This message has no answer of its own; ArduPilot acknowledges it like a command of its number.
      if (decoded<mavlink_set_mode_t>(mavlink_msg_set_mode_decode, message).target_system != kCarSystem) return;
      return commands_.refuse(MAVLINK_MSG_ID_SET_MODE, sender.host, MAV_RESULT_UNSUPPORTED);
    default: {
      const auto sticks = decoded<mavlink_rc_channels_override_t>(mavlink_msg_rc_channels_override_decode, message);
      if (is_for_car(sticks) && overrides(sticks)) complain("RC_CHANNELS_OVERRIDE: drive with MANUAL_CONTROL");
      return;
    }
  }
}

// Notes the time of a packet of this MAVLink system. Returns whether it has sent another one within kKnownHostMs
// before.
bool Link::note_host(std::uint8_t system) {
  // Odd, so never 0, which stands for a host without a packet.
  const auto now_ms = static_cast<std::uint32_t>(hal_.clock.now_us() / 1000) | 1;
  const std::uint32_t previous_ms = last_packet_ms_[system];
  last_packet_ms_[system] = now_ms;
  const bool known = previous_ms != 0 && now_ms - previous_ms <= kKnownHostMs;
  host_is_new_ = host_is_new_ || !known;
  return known;
}

// Sends "refused: why" as a status text, at most one in kComplaintUs.
void Link::complain(const char* why) {
  const std::uint64_t now_us = hal_.clock.now_us();
  if (now_us < next_complaint_us_) return;
  next_complaint_us_ = now_us + kComplaintUs;
  status_text_.send(MAV_SEVERITY_WARNING, "refused:", why);
}

// Drives by a stick's position (MANUAL_CONTROL). While another host controls the car, sticks that move are refused.
void Link::drive_manually(const mavlink_message_t& message, const Sender& sender) {
  const auto stick = decoded<mavlink_manual_control_t>(mavlink_msg_manual_control_decode, message);
  if (stick.target != kCarSystem || !sender.known) return;
  const auto axis = [](std::int16_t value) {
    return std::abs(value) <= 1000 ? 0.001f * static_cast<float>(value) : 0.0f;
  };
  // As ground stations steer a rover with one stick: y to the right, as on the stick. z is left alone, because a
  // throttle at rest may be anything from 0 to 500; so is r, whose sign depends on the age of MAVLink's definition.
  const float forward = axis(stick.x), left = -axis(stick.y);
  const bool moves = forward != 0.0f || left != 0.0f;
  if (is_controlled_by_other(sender)) {
    if (moves) complain(HeldBy(controlling_host_).text);
    return;
  }
  const Refusal refusal = trial_log_.is_idle() ? application_.drive_manually(forward, left) : Refusal::kStoring;
  if (moves && refusal != Refusal::kNone) complain(text(refusal));
}

// Answers MISSION_REQUEST_LIST with a mission of 0 items: the car has no missions, but ground stations ask every
// vehicle for its mission and wait for the answer.
void Link::answer_mission_list(const mavlink_message_t& message) {
  const auto request = decoded<mavlink_mission_request_list_t>(mavlink_msg_mission_request_list_decode, message);
  if (!is_for_car(request)) return;
  mavlink_mission_count_t answer{};
  answer.target_system = message.sysid;
  answer.target_component = message.compid;
  answer.mission_type = request.mission_type;
  outbox_.send(mavlink_msg_mission_count_encode_status, answer, Priority::kAnswer);
}

// Answers a request for time (tc1 is 0) with the car's time, and the host's time as it was sent; both in nanoseconds.
void Link::answer_timesync(const mavlink_message_t& message) {
  const auto request = decoded<mavlink_timesync_t>(mavlink_msg_timesync_decode, message);
  if (request.tc1 != 0) return;
  mavlink_timesync_t answer{};
  answer.tc1 = static_cast<std::int64_t>(1000 * hal_.clock.now_us());
  answer.ts1 = request.ts1;
  outbox_.send(mavlink_msg_timesync_encode_status, answer, Priority::kAnswer);
}

// Answers a ping that is addressed to all with the same packet, addressed to its sender.
void Link::answer_ping(const mavlink_message_t& message) {
  auto ping = decoded<mavlink_ping_t>(mavlink_msg_ping_decode, message);
  if (ping.target_system != 0 || ping.target_component != 0) return;
  ping.target_system = message.sysid;
  ping.target_component = message.compid;
  outbox_.send(mavlink_msg_ping_encode_status, ping, Priority::kAnswer);
}

// Reports a fault and a host's time-out when they begin, and again to hosts that connect later; to these also once where
// the program was at a crash.
void Link::report_changes() {
  const Fault fault = application_.status().fault;
  const bool host_timed_out = application_.host_timed_out();
  if (fault != reported_fault_ || (host_is_new_ && fault != Fault::kNone)) report_fault();
  if (host_timed_out && (!reported_host_timeout_ || host_is_new_)) report_host_timeout();
  if (host_is_new_) send_crash_report();
  reported_fault_ = fault;
  reported_host_timeout_ = host_timed_out;
  host_is_new_ = false;
}

void Link::report_fault() {
  const Fault fault = application_.status().fault;
  if (fault == Fault::kNone) return status_text_.send(MAV_SEVERITY_NOTICE, "fault acknowledged");
  status_text_.send(MAV_SEVERITY_CRITICAL, "fault:", text(fault));
  if (fault == Fault::kDesign) status_text_.send(MAV_SEVERITY_ERROR, application_.design().problem);
  if (is_absent(application_.design().source)) {
    status_text_.send(MAV_SEVERITY_ERROR, "load a design, or confirm that the parameters describe the car");
  }
}

void Link::send_crash_report() {
  mavlink_message_t message;
  if (!compose(MAVLINK_MSG_ID_FOLDCAR_CRASH, view(), outbox_.numbers(), message)) return;
  outbox_.send(message, Priority::kAnswer);
}

void Link::report_host_timeout() {
  // In tenths, because printing a float may take memory from the heap.
  const long tenths = std::lround(10.0f * application_.parameters().get(Parameter::kArmTimeoutS));
  char line[96];
  std::snprintf(line, sizeof line, "disarmed: %s was silent for %ld.%ld s", HostName(controlling_host_).text, tenths / 10,
                tenths % 10);
  status_text_.send(MAV_SEVERITY_WARNING, line);
}

CarView Link::view() const {
  const LinkStatistics link{parser_.packet_count(), parser_.bad_byte_count(), outbox_.unsent_count()};
  return {application_, hal_, loop_, link, trial_log_.status(), build_};
}

bool Link::restart_is_due() const {
  const bool is_stored = trial_log_.is_idle() && !application_.unsaved_parameter();
  return commands_.restart_is_due() && is_stored && !application_.is_driving();
}

}  // namespace foldcar
