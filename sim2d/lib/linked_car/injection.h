// Fault injection: the faults that a simulated car can be given, each as a line of JSON (docs/carsim.md).
#pragma once

#include <optional>

#include "json_reader.h"

namespace foldcar {

// One fault.
struct Injection {
  enum class Kind {
    kBattery,            // value: voltage (V)
    kBatteryUnreadable,
    kServoBattery,       // value: voltage (V), as a car measures it whose divider is wired
    kBusError,
    kImuError,
    kBrownOut,
    kWatchdog,           // value: address in the firmware, 0 if it is not known; of kCrash, too
    kCrash,
    kButton,  // someone presses it
    kUnplug,
    kCorrupt,            // value: fraction of the bytes that arrive wrong
    kDrop,               // value: fraction of the bytes that are lost
    kPutBack
  };
  Kind kind = Kind::kPutBack;
  double value = 0;
  std::optional<double> for_s;  // duration (s); without one the fault stays
};

// Reads {"inject": kind, …}. Throws InputError, which names key and limit.
Injection read_injection(const nlohmann::json& line);

}  // namespace foldcar
