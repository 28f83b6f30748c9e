// Faults that a simulated car is given: a line of JSON each, as docs/carsim.md describes them.
#pragma once

#include <optional>

#include "json_reader.h"

namespace foldcar {

// One fault.
struct Injection {
  enum class Kind {
    kBattery,            // value: volts
    kBatteryUnreadable,
    kBusError,
    kImuError,
    kBrownOut,
    kWatchdog,
    kUnplug,
    kCorrupt,            // value: share of the bytes
    kDrop,               // the same
    kPutBack
  };
  Kind kind = Kind::kPutBack;
  double value = 0;
  std::optional<double> for_s;  // else for good
};

// Reads {"inject": kind, …}. InputError.
Injection read_injection(const nlohmann::json& line);

}  // namespace foldcar
