#include "command_service.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>

namespace foldcar {
namespace {

constexpr float kLargestTrialId = 16777215.0f;  // 2^24 - 1: a float holds every whole number up to it
constexpr float kLargestMessageId = 16777215.0f;
// A host that receives no acknowledgement repeats the command within this time (µs); a later one is a new command.
constexpr std::uint64_t kRepetitionUs = 5000000;

// MAVLink's result for a refusal: denied if the request itself is wrong, temporarily rejected if it may succeed later.
MAV_RESULT result_of(Refusal refusal) {
  switch (refusal) {
    case Refusal::kNone: return MAV_RESULT_ACCEPTED;
    case Refusal::kNoWheels:
    case Refusal::kNotANumber:
    case Refusal::kSpeedLimit:
    case Refusal::kYawRateLimit:
    case Refusal::kTimeLimit:
    case Refusal::kDelay:
    case Refusal::kTest:
    case Refusal::kMessage: return MAV_RESULT_DENIED;
    case Refusal::kUnknownCommand: return MAV_RESULT_UNSUPPORTED;
    default: return MAV_RESULT_TEMPORARILY_REJECTED;
  }
}

// Whether the command stops the car. Such commands are executed for any host at any time.
bool ends_driving(const mavlink_command_long_t& command) {
  return command.command == MAV_CMD_FOLDCAR_STOP_TRIAL ||
         (command.command == MAV_CMD_COMPONENT_ARM_DISARM && command.param1 == 0.0f);
}

// Whether the command sets wheels in motion.
bool moves(const mavlink_command_long_t& command) {
  return command.command == MAV_CMD_FOLDCAR_START_TRIAL || command.command == MAV_CMD_ACTUATOR_TEST;
}

// Whether the command, if it arms the car, makes its sender the controlling host.
bool takes_control(const mavlink_command_long_t& command) {
  return command.command == MAV_CMD_COMPONENT_ARM_DISARM || command.command == MAV_CMD_ACTUATOR_TEST;
}

// Whether the command is executed for the controlling host only while the car is armed.
bool controls(const mavlink_command_long_t& command) {
  if (ends_driving(command)) return false;
  return moves(command) || takes_control(command) || command.command == MAV_CMD_PREFLIGHT_STORAGE ||
         command.command == MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN;
}

bool is_whole(float value, float largest) { return value >= 0.0f && value <= largest && value == std::floor(value); }

}  // namespace

// Executes a command, unless it is late or repeats the last one (then the last answer is repeated), and acknowledges
// it.
void CommandService::handle(const mavlink_command_long_t& command, const Sender& sender, const CarView& car,
                            Host& controlling_host) {
  const bool was_armed = application_.is_armed();
  Answer answer;
  if (sender.late && !ends_driving(command)) {
    answer = {MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kLate};
  } else if (is_repeated(command, sender.host)) {
    return acknowledge(command.command, sender.host, last_answer_);
  } else {
    answer = execute(command, sender, car, controlling_host);
    const bool executed = answer.refusal == Refusal::kNone;
    if (executed && application_.is_armed() && takes_control(command)) controlling_host = sender.host;
    last_ = command;
    last_host_ = sender.host;
    last_us_ = hal_.clock.now_us();
    last_answer_ = answer;
    has_last_ = true;
  }
  report(command, sender.host, answer, was_armed, controlling_host);
  acknowledge(command.command, sender.host, answer);
}

void CommandService::refuse(std::uint16_t command, const Host& host, MAV_RESULT result) {
  status_text_.send(MAV_SEVERITY_WARNING, "refused:", text(Refusal::kUnknownCommand));
  acknowledge(command, host, {result, Refusal::kUnknownCommand});
}

// Sends a status text for what people should see: a refusal with its reason, arming and disarming, a stop by another
// host.
void CommandService::report(const mavlink_command_long_t& command, const Host& host, const Answer& answer,
                            bool was_armed, const Host& controlling_host) {
  if (answer.refusal == Refusal::kHeld) {
    status_text_.send(MAV_SEVERITY_WARNING, "refused:", HeldBy(controlling_host).text);
  } else if (answer.refusal == Refusal::kDesign) {
    status_text_.send(MAV_SEVERITY_WARNING, "refused:", application_.design().problem);
  } else if (command.command == MAV_CMD_REQUEST_MESSAGE && answer.refusal == Refusal::kMessage) {
    // Ground stations try which messages a vehicle has. The acknowledgement tells them.
  } else if (answer.refusal != Refusal::kNone) {
    status_text_.send(MAV_SEVERITY_WARNING, "refused:", text(answer.refusal));
  } else if (command.command == MAV_CMD_COMPONENT_ARM_DISARM && was_armed != application_.is_armed()) {
    status_text_.send(MAV_SEVERITY_NOTICE, was_armed ? "disarmed by" : "armed by", HostName(host).text);
  } else if (command.command == MAV_CMD_FOLDCAR_STOP_TRIAL && was_armed && host != controlling_host) {
    status_text_.send(MAV_SEVERITY_NOTICE, "stopped by", HostName(host).text);
  }
}

void CommandService::acknowledge(std::uint16_t command, const Host& host, const Answer& answer) {
  mavlink_command_ack_t ack{};
  ack.command = command;
  ack.result = static_cast<std::uint8_t>(answer.result);
  ack.result_param2 = static_cast<std::int32_t>(answer.refusal);
  ack.target_system = host.system;
  ack.target_component = host.component;
  outbox_.send(mavlink_msg_command_ack_encode_status, ack, Priority::kAnswer);
}

// Checks that the sender may give the command now, then carries it out.
CommandService::Answer CommandService::execute(const mavlink_command_long_t& command, const Sender& sender,
                                               const CarView& car, const Host& controlling_host) {
  const auto answer = [](Refusal refusal) { return Answer{result_of(refusal), refusal}; };
  if (moves(command) && !sender.known) return answer(Refusal::kUnknownHost);
  if (controls(command) && application_.is_armed() && sender.host != controlling_host) return answer(Refusal::kHeld);
  // Erasing flash stops both cores for up to 0.4 s.
  if (moves(command) && !trial_log_.is_idle()) return answer(Refusal::kStoring);
  switch (command.command) {
    case MAV_CMD_COMPONENT_ARM_DISARM: return arm_or_disarm(command.param1);
    case MAV_CMD_FOLDCAR_START_TRIAL: return start(command);
    case MAV_CMD_FOLDCAR_STOP_TRIAL: return answer(application_.stop());
    case MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT: return answer(application_.acknowledge(command.param1 == 1.0f));
    case MAV_CMD_ACTUATOR_TEST: return test(command);
    case MAV_CMD_SET_MESSAGE_INTERVAL: {
      if (!is_whole(command.param1, kLargestMessageId)) return answer(Refusal::kMessage);
      const auto message_id = static_cast<std::uint32_t>(command.param1);
      const bool known = telemetry_.set_interval(message_id, command.param2, hal_.clock.now_us());
      return answer(known ? Refusal::kNone : Refusal::kMessage);
    }
    case MAV_CMD_GET_MESSAGE_INTERVAL: return send_interval(command.param1);
    case MAV_CMD_REQUEST_MESSAGE:
      if (!is_whole(command.param1, kLargestMessageId)) return answer(Refusal::kMessage);
      return send_message(static_cast<std::uint32_t>(command.param1), car);
    case MAV_CMD_PREFLIGHT_STORAGE: return reset_parameters(command.param1);
    case MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: return restart(command.param1);
    default: return answer(Refusal::kUnknownCommand);
  }
}

CommandService::Answer CommandService::arm_or_disarm(float arm) {
  if (arm != 0.0f && arm != 1.0f) return {MAV_RESULT_DENIED, Refusal::kNotANumber};
  const Refusal refusal = arm == 1.0f ? application_.arm() : application_.disarm();
  return {result_of(refusal), refusal};
}

// Tests one output. param5: the output, param1: -1 to 1 for pulses of 1000 to 2000 µs whatever the parameters, or NaN
// for no pulse, param2: the test's time (s).
CommandService::Answer CommandService::test(const mavlink_command_long_t& command) {
  constexpr float kFirst = ACTUATOR_OUTPUT_FUNCTION_SERVO1;
  const float output = command.param5 - kFirst;
  if (!is_whole(output, kChannelCount - 1)) return {MAV_RESULT_DENIED, Refusal::kTest};
  const float value = command.param1;
  if (std::fabs(value) > 1.0f) return {MAV_RESULT_DENIED, Refusal::kTest};
  const float pulse_us = std::isnan(value) ? kNoPulse : 1500.0f + 500.0f * value;
  const Refusal refusal = application_.test(static_cast<std::size_t>(output), pulse_us, command.param2);
  return {result_of(refusal), refusal};
}

// Starts a trial. param1: speed (m/s), 2: yaw rate (rad/s), 3: time limit (s), 4: flags, 5: trial's number, 6: delay
// (s).
CommandService::Answer CommandService::start(const mavlink_command_long_t& command) {
  // The button is for a car without a cable.
  constexpr float kFlags[] = {0, FOLDCAR_TRIAL_FLAGS_UNTETHERED, FOLDCAR_TRIAL_FLAGS_UNTETHERED | FOLDCAR_TRIAL_FLAGS_BUTTON};
  const bool has_flags = std::find(std::begin(kFlags), std::end(kFlags), command.param4) != std::end(kFlags);
  if (!has_flags || !is_whole(command.param5, kLargestTrialId)) return {MAV_RESULT_DENIED, Refusal::kNotANumber};
  TrialRequest request;
  request.speed_m_s = command.param1;
  request.yaw_rate_rad_s = command.param2;
  request.time_limit_s = command.param3;
  request.untethered = command.param4 != 0.0f;
  request.waits_for_button = command.param4 > FOLDCAR_TRIAL_FLAGS_UNTETHERED;
  request.delay_s = command.param6;
  request.id = static_cast<std::uint32_t>(command.param5);
  const bool lacks_log = request.untethered && !hal_.logs.present();
  const Refusal refusal = lacks_log ? Refusal::kNoLog : application_.start(request);
  return {result_of(refusal), refusal};
}

// Sends a message once, as REQUEST_MESSAGE asks; with a refused design also what is wrong with it.
CommandService::Answer CommandService::send_message(std::uint32_t message_id, const CarView& car) {
  mavlink_message_t message;
  if (!compose(message_id, car, outbox_.numbers(), message)) return {MAV_RESULT_DENIED, Refusal::kMessage};
  outbox_.send(message, Priority::kAnswer);
  const DesignResult& design = application_.design();
  if (message_id == MAVLINK_MSG_ID_FOLDCAR_DESIGN && design.source == DesignSource::kRefused) {
    status_text_.send(MAV_SEVERITY_ERROR, design.problem);
  }
  return {};
}

CommandService::Answer CommandService::send_interval(float message_id) {
  if (!is_whole(message_id, 65535.0f)) return {MAV_RESULT_DENIED, Refusal::kMessage};
  mavlink_message_interval_t content{};
  content.message_id = static_cast<std::uint16_t>(message_id);
  content.interval_us = telemetry_.interval_us(content.message_id);
  outbox_.send(mavlink_msg_message_interval_encode_status, content, Priority::kAnswer);
  return {};
}

CommandService::Answer CommandService::reset_parameters(float request) {
  constexpr float kResetAll = 2.0f;
  if (request != kResetAll) return {MAV_RESULT_UNSUPPORTED, Refusal::kUnknownCommand};
  if (application_.is_driving()) return {MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kRunning};
  if (!trial_log_.is_idle()) return {MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kStoring};
  return {application_.reset_parameters() ? MAV_RESULT_ACCEPTED : MAV_RESULT_FAILED, Refusal::kNone};
}

CommandService::Answer CommandService::restart(float request) {
  if (request != 1.0f) return {MAV_RESULT_UNSUPPORTED, Refusal::kUnknownCommand};
  if (application_.is_driving()) return {MAV_RESULT_TEMPORARILY_REJECTED, Refusal::kRunning};
  restart_is_due_ = true;
  return {};
}

// Returns whether a host repeats its last command. The repetition has a confirmation above 0; all other fields are
// equal.
bool CommandService::is_repeated(const mavlink_command_long_t& command, const Host& host) const {
  if (!has_last_ || command.confirmation == 0 || host != last_host_) return false;
  if (hal_.clock.now_us() - last_us_ > kRepetitionUs) return false;
  mavlink_command_long_t first = command;
  first.confirmation = last_.confirmation;
  // Bytes are compared, because a parameter may be NaN, which does not equal itself. MAVLink's structs have no
  // padding.
  return std::memcmp(&first, &last_, sizeof first) == 0;  // NOLINT(bugprone-suspicious-memory-comparison)
}

}  // namespace foldcar
