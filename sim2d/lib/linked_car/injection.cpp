#include "injection.h"

#include <algorithm>
#include <array>

namespace foldcar {
namespace {

constexpr Limits kVolts{0, 30};
constexpr Limits kShare{0, 1};
constexpr Limits kDuration_s{0, 3600};
constexpr Limits kAddress{0, 4294967295.0};

}  // namespace

Injection read_injection(const nlohmann::json& line) {
  using Kind = Injection::Kind;
  const std::vector<std::string> names = {"battery", "battery_unreadable", "servo_battery", "bus_error", "imu_error",
                                          "brown_out", "watchdog", "crash", "button", "unplug", "corrupt", "drop", "put_back"};
  JsonReader reader(line, "line");
  Injection injection;
  injection.kind = static_cast<Kind>(reader.choice("inject", names));
  const bool is_battery = injection.kind == Kind::kBattery || injection.kind == Kind::kServoBattery;
  if (is_battery) injection.value = reader.number("volts", kVolts);
  if (injection.kind == Kind::kCorrupt || injection.kind == Kind::kDrop) {
    injection.value = reader.number("share", kShare);
  }
  const bool has_place = injection.kind == Kind::kWatchdog || injection.kind == Kind::kCrash;
  if (has_place && reader.has("address")) injection.value = reader.number("address", kAddress);
  constexpr std::array<Kind, 4> kMomentary = {Kind::kBrownOut, Kind::kWatchdog, Kind::kCrash, Kind::kPutBack};
  const bool lasts = std::find(kMomentary.begin(), kMomentary.end(), injection.kind) == kMomentary.end();
  if (lasts && reader.has("for_s")) injection.for_s = reader.number("for_s", kDuration_s);
  reader.finish();
  return injection;
}

}  // namespace foldcar
