#include "parameter_service.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace foldcar {
namespace {

constexpr std::size_t kIdSize = sizeof(mavlink_param_value_t::param_id);

// A name of 16 characters has no closing zero in a MAVLink packet.
struct Name {
  explicit Name(const char (&id)[kIdSize]) { std::copy_n(id, kIdSize, text); }
  char text[kIdSize + 1] = "";
};

Refusal refusal_of(SetResult result) {
  switch (result) {
    case SetResult::kOk: return Refusal::kNone;
    case SetResult::kUnknownName: return Refusal::kUnknownParameter;
    case SetResult::kNotANumber: return Refusal::kNotANumber;
    case SetResult::kBelowMinimum: return Refusal::kBelowMinimum;
    case SetResult::kAboveMaximum: return Refusal::kAboveMaximum;
    case SetResult::kNotAnInteger: return Refusal::kNotAnInteger;
    case SetResult::kNotASign: return Refusal::kNotASign;
    case SetResult::kFixed: return Refusal::kFixed;
  }
  return Refusal::kNone;
}

}  // namespace

void ParameterService::list() { next_index_ = 0; }

void ParameterService::read(const mavlink_param_request_read_t& request) {
  if (request.param_index >= 0) {
    if (request.param_index < static_cast<int>(kParameterCount)) send(static_cast<std::size_t>(request.param_index));
    return;
  }
  const Name name(request.param_id);
  const std::optional<Parameter> parameter = find_parameter(name.text);
  if (!parameter) return report_refusal(name.text, Refusal::kUnknownParameter, text(SetResult::kUnknownName));
  send(static_cast<std::size_t>(*parameter));
}

// Sets a parameter and sends its value then, which tells the host whether it was set. Saved later, by run().
void ParameterService::set(const mavlink_param_set_t& request) {
  // Writing to flash would delay the loop.
  if (application_.is_driving()) return refuse(request, Refusal::kRunning, "wheels are driven");
  const Name name(request.param_id);
  const std::optional<Parameter> parameter = find_parameter(name.text);
  const SetResult result =
      parameter ? application_.set_parameter(*parameter, request.param_value) : SetResult::kUnknownName;
  if (result != SetResult::kOk) report_refusal(name.text, refusal_of(result), text(result));
  if (parameter) send(static_cast<std::size_t>(*parameter));
}

void ParameterService::refuse(const mavlink_param_set_t& request, Refusal refusal, const char* why) {
  const Name name(request.param_id);
  char sentence[64];
  std::snprintf(sentence, sizeof sentence, "is not set: %s", why);
  report_refusal(name.text, refusal, sentence);
  const std::optional<Parameter> parameter = find_parameter(name.text);
  if (parameter) send(static_cast<std::size_t>(*parameter));
}

void ParameterService::run(bool may_save) {
  while (next_index_ < kParameterCount && outbox_.has_room_for(8) && send(next_index_)) ++next_index_;
  if (may_save) save_one();
}

// Saves one parameter that has changed. One in a tick, so that a parameter that is set many times is saved once and a
// burst of settings does not delay the loop.
void ParameterService::save_one() {
  const std::optional<Parameter> parameter = application_.unsaved_parameter();
  if (!parameter || application_.save_parameter(*parameter)) return;
  report_refusal(parameter_info(*parameter).name, Refusal::kNotSaved, "is set, but could not be saved");
}

bool ParameterService::send(std::size_t index) {
  const ParameterInfo& info = parameter_table()[index];
  mavlink_param_value_t content{};
  std::copy_n(info.name, std::strlen(info.name), content.param_id);
  content.param_value = application_.parameters().get(static_cast<Parameter>(index));
  content.param_type = MAV_PARAM_TYPE_REAL32;
  content.param_count = static_cast<std::uint16_t>(kParameterCount);
  content.param_index = static_cast<std::uint16_t>(index);
  return outbox_.send(mavlink_msg_param_value_encode_status, content, Priority::kAnswer);
}

void ParameterService::report_refusal(const char* name, Refusal refusal, const char* why) {
  mavlink_foldcar_param_refused_t content{};
  std::copy_n(name, std::min(std::strlen(name), kIdSize), content.param_id);
  content.reason = static_cast<std::uint8_t>(refusal);
  mavlink_message_t message;
  mavlink_msg_foldcar_param_refused_encode_status(kCarSystem, kOwnComponent, &outbox_.numbers().own, &message, &content);
  outbox_.send(message, Priority::kAnswer);
  status_text_.send(MAV_SEVERITY_WARNING, name, why);
}

}  // namespace foldcar
