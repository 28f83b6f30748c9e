#include "parameters.h"

#include <cmath>

namespace foldcar {
namespace {

SetResult check(const ParameterInfo& info, float value) {
  if (std::isnan(value)) return SetResult::kNotANumber;
  if (value < info.minimum) return SetResult::kBelowMinimum;
  if (value > info.maximum) return SetResult::kAboveMaximum;
  if (info.kind == ParameterKind::kInteger && value != std::floor(value)) return SetResult::kNotAnInteger;
  if (info.kind == ParameterKind::kSign && value != -1.0f && value != 1.0f) return SetResult::kNotASign;
  return SetResult::kOk;
}

}  // namespace

const char* text(SetResult result) {
  switch (result) {
    case SetResult::kOk: return "is set";
    case SetResult::kUnknownName: return "is not a parameter";
    case SetResult::kNotANumber: return "is not a number";
    case SetResult::kBelowMinimum: return "is below its minimum";
    case SetResult::kAboveMaximum: return "is above its maximum";
    case SetResult::kNotAnInteger: return "is not a whole number";
    case SetResult::kNotASign: return "is neither -1 nor 1";
    case SetResult::kFixed: return "is set by car.json";
  }
  return "?";
}

Parameters::Parameters() {
  for (std::size_t i = 0; i < kParameterCount; ++i) values_[i] = parameter_table()[i].default_value;
}

SetResult Parameters::set(Parameter parameter, float value) {
  const SetResult result =
      fixed_[static_cast<std::size_t>(parameter)] ? SetResult::kFixed : check(parameter_info(parameter), value);
  if (result == SetResult::kOk) values_[static_cast<std::size_t>(parameter)] = value;
  return result;
}

SetResult Parameters::set(const char* name, float value) {
  const std::optional<Parameter> parameter = find_parameter(name);
  return parameter ? set(*parameter, value) : SetResult::kUnknownName;
}

SetResult Parameters::fix(Parameter parameter, float value) {
  const SetResult result = set(parameter, value);
  if (result == SetResult::kOk) fixed_[static_cast<std::size_t>(parameter)] = true;
  return result;
}

std::size_t Parameters::load(Storage& storage) {
  std::size_t refused_count = 0;
  for (std::size_t i = 0; i < kParameterCount; ++i) {
    float value = 0.0f;
    if (fixed_[i] || !storage.load(parameter_table()[i].name, value)) continue;
    if (set(static_cast<Parameter>(i), value) != SetResult::kOk) ++refused_count;
  }
  return refused_count;
}

bool Parameters::save(Storage& storage, Parameter parameter) const {
  return storage.save(parameter_info(parameter).name, get(parameter));
}

}  // namespace foldcar
