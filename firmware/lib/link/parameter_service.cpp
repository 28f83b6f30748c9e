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

}  // namespace

void ParameterService::list() { next_index_ = 0; }

void ParameterService::read(const mavlink_param_request_read_t& request) {
  if (request.param_index >= 0) {
    if (request.param_index < static_cast<int>(kParameterCount)) send(static_cast<std::size_t>(request.param_index));
    return;
  }
  const Name name(request.param_id);
  const std::optional<Parameter> parameter = find_parameter(name.text);
  if (!parameter) return report_refusal(name.text, text(SetResult::kUnknownName));
  send(static_cast<std::size_t>(*parameter));
}

void ParameterService::set(const mavlink_param_set_t& request, const char* obstacle) {
  const Name name(request.param_id);
  const std::optional<Parameter> parameter = find_parameter(name.text);
  if (!parameter) return report_refusal(name.text, text(SetResult::kUnknownName));
  if (obstacle != nullptr) {
    char why[64];
    std::snprintf(why, sizeof why, "is not set: %s", obstacle);
    report_refusal(name.text, why);
  } else if (application_.is_driving()) {
    // Writing to flash would delay the loop.
    report_refusal(name.text, "cannot be set while wheels are driven");
  } else {
    const SetResult result = application_.set_parameter(*parameter, request.param_value);
    if (result != SetResult::kOk) report_refusal(name.text, text(result));
  }
  send(static_cast<std::size_t>(*parameter));
}

void ParameterService::run(bool may_save) {
  while (next_index_ < kParameterCount && outbox_.has_room_for(8) && send(next_index_)) ++next_index_;
  if (may_save) save_one();
}

// One in a tick: a parameter that is set many times is saved once, and no burst of settings delays the loop.
void ParameterService::save_one() {
  const std::optional<Parameter> parameter = application_.unsaved_parameter();
  if (!parameter || application_.save_parameter(*parameter)) return;
  report_refusal(parameter_info(*parameter).name, "is set, but could not be saved");
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

void ParameterService::report_refusal(const char* name, const char* why) {
  status_text_.send(MAV_SEVERITY_WARNING, name, why);
}

}  // namespace foldcar
