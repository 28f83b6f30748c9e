// The values of one car's parameters.
//
// A new object holds the table's defaults. Only values within their limits are accepted, so that code that reads one needs
// no check. Reading is an array access; names are for hosts and flash memory.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal.h"
#include "parameter_table.h"

namespace foldcar {

// Whether a value was accepted, or why not.
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

  // The value in the parameter's unit; channel counts from 0.
  float get(Parameter parameter) const { return values_[static_cast<std::size_t>(parameter)]; }
  float get(std::size_t channel, ChannelParameter parameter) const {
    return get(channel_parameter(channel, parameter));
  }

  // Any result but kOk leaves the value unchanged.
  SetResult set(Parameter parameter, float value);
  SetResult set(const char* name, float value);

  // Sets a value that only another car.json may change: every later set returns kFixed.
  SetResult fix(Parameter parameter, float value);

  // Sets every stored value that is not fixed. Returns the number of stored values that were refused; those parameters
  // keep their values.
  std::size_t load(Storage& storage);

  // Stores one value. Returns false if storage failed.
  bool save(Storage& storage, Parameter parameter) const;

 private:
  std::array<float, kParameterCount> values_;
  std::array<bool, kParameterCount> fixed_{};
};

}  // namespace foldcar
