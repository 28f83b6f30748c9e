// The values of one car's parameters.
//
// A new object holds the table's defaults. A value gets in only if it is within its limits, so whoever reads
// one needs no check. Reading is an array access; names are for the edges (host, flash).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal.h"
#include "parameter_table.h"

namespace foldcar {

enum class SetResult : std::uint8_t {
  kOk,
  kUnknownName,
  kNotANumber,
  kBelowMinimum,
  kAboveMaximum,
  kNotAnInteger,
  kNotASign,
  kFixed
};

// Completes the sentence "NAME …", as in "TRACK_M is below its minimum".
const char* text(SetResult result);

class Parameters {
 public:
  Parameters();

  float get(Parameter parameter) const { return values_[static_cast<std::size_t>(parameter)]; }
  float get(std::size_t channel, ChannelParameter parameter) const {
    return get(channel_parameter(channel, parameter));
  }

  // Anything but kOk leaves the value as it is.
  SetResult set(Parameter parameter, float value);
  SetResult set(const char* name, float value);

  // Sets a value that only another car.json changes: every later set is refused.
  SetResult fix(Parameter parameter, float value);

  // Takes every value that storage has, of those that are not fixed. Returns how many of them were refused;
  // those keep their value.
  std::size_t load(Storage& storage);

  // Saves one value. False if storage did not take it.
  bool save(Storage& storage, Parameter parameter) const;

 private:
  std::array<float, kParameterCount> values_;
  std::array<bool, kParameterCount> fixed_{};
};

}  // namespace foldcar
