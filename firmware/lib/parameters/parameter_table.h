// The declaration of every parameter: name, unit, limits, default, help.
//
// Hosts request this table, `carsim params` prints it, and Parameters checks values against it. Channels count from 1 to 8
// in names (CH1_SIDE) and from 0 to 7 in code.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "hal.h"

namespace foldcar {

enum class ParameterKind : std::uint8_t { kReal, kInteger, kSign };  // kSign: -1 or 1

// Longest name without the closing zero: MAVLink allows 16 characters, the ESP32's flash keys 15.
constexpr std::size_t kNameLength = 15;

// minimum, maximum and default_value are in the unit.
struct ParameterInfo {
  char name[kNameLength + 1];
  const char* unit;  // "" if it has none
  float minimum;
  float maximum;
  float default_value;
  ParameterKind kind;
  const char* help;
};

// Index of a parameter in the table. Indices from kCount on belong to channels: see channel_parameter.
enum class Parameter : std::uint8_t {
  kWheelRadiusM,
  kTrackM,
  kWheelMaxRadS,
  kSlewUsPerS,
  kStaggerMs,
  kBattMinV,
  kServoMinV,
  kBattLowMs,
  kCmdTimeoutMs,
  kArmTimeoutS,
  kTrialMaxS,
  kTiltMaxRad,
  kTiltMs,
  kPwmOscHz,
  kOeWired,
  kButtonWired,
  kServoDivider,
  kCount
};

// The parameters that each channel has.
enum class ChannelParameter : std::uint8_t { kSide, kDirection, kReversed, kNeutralUs, kDeadbandUs, kGainUs, kCount };

// Values of CHn_SIDE.
enum class Side : std::uint8_t { kUnused, kLeft, kRight };

constexpr std::size_t kCarParameterCount = static_cast<std::size_t>(Parameter::kCount);
constexpr std::size_t kParametersPerChannel = static_cast<std::size_t>(ChannelParameter::kCount);
constexpr std::size_t kParameterCount = kCarParameterCount + kChannelCount * kParametersPerChannel;

// The index of a channel's parameter; channel counts from 0.
constexpr Parameter channel_parameter(std::size_t channel, ChannelParameter parameter) {
  return static_cast<Parameter>(kCarParameterCount + channel * kParametersPerChannel +
                                static_cast<std::size_t>(parameter));
}

// The whole table, in the order of the indices.
const std::array<ParameterInfo, kParameterCount>& parameter_table();

const ParameterInfo& parameter_info(Parameter parameter);
// The index of the parameter with that name, if there is one.
std::optional<Parameter> find_parameter(const char* name);

}  // namespace foldcar
