// The one declaration of every parameter: name, unit, limits, default, help.
//
// The table is what a host asks for, what `carsim params` prints and what Parameters checks values against.
// Channels count 1 to 8 in names (CH1_SIDE), as on the board's silk screen, and 0 to 7 everywhere in code.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "hal.h"

namespace foldcar {

enum class ParameterKind : std::uint8_t { kReal, kInteger, kSign };  // kSign: -1 or 1

// Longest name without the closing zero. MAVLink allows 16, the board's flash keys only 15.
constexpr std::size_t kNameLength = 15;

struct ParameterInfo {
  char name[kNameLength + 1];
  const char* unit;  // "" if it has none
  float minimum;
  float maximum;
  float default_value;
  ParameterKind kind;
  const char* help;
};

// Index into the table. Those after kCount belong to channels: see channel_parameter.
enum class Parameter : std::uint8_t {
  kWheelRadiusM,
  kTrackM,
  kWheelMaxRadS,
  kSlewUsPerS,
  kStaggerMs,
  kBattMinV,
  kBattLowMs,
  kCmdTimeoutMs,
  kTrialMaxS,
  kTiltMaxRad,
  kTiltMs,
  kPwmOscHz,
  kCount
};

enum class ChannelParameter : std::uint8_t { kSide, kDirection, kNeutralUs, kDeadbandUs, kGainUs, kCount };

// Values of CHn_SIDE.
enum class Side : std::uint8_t { kUnused, kLeft, kRight };

constexpr std::size_t kCarParameterCount = static_cast<std::size_t>(Parameter::kCount);
constexpr std::size_t kParametersPerChannel = static_cast<std::size_t>(ChannelParameter::kCount);
constexpr std::size_t kParameterCount = kCarParameterCount + kChannelCount * kParametersPerChannel;

// channel counts from 0.
constexpr Parameter channel_parameter(std::size_t channel, ChannelParameter parameter) {
  return static_cast<Parameter>(kCarParameterCount + channel * kParametersPerChannel +
                                static_cast<std::size_t>(parameter));
}

// In the order of the indices.
const std::array<ParameterInfo, kParameterCount>& parameter_table();

const ParameterInfo& parameter_info(Parameter parameter);
std::optional<Parameter> find_parameter(const char* name);

}  // namespace foldcar
