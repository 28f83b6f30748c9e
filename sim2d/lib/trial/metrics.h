// The metrics of a run: the numbers that describe how a trial went, declared once.
//
// A new metric is a field of Metrics, a row of kMetrics and its computation in Trial::observe() (trial.cpp). The
// protocol writes the rows of this table, and `carsim metrics` prints them, so that no other program needs a list.
#pragma once

#include <array>
#include <optional>
#include <variant>

namespace foldcar {

// SI units. Each holds from the start of the trial to the moment that it is asked for.
struct Metrics {
  double elapsed_time_s = 0;
  std::optional<double> distance_to_target_m;  // of the car's origin, in the ground plane; none without a goal
  double consumed_energy_j = 0;                // electrical energy drawn from the servo supply
  double max_roll_rad = 0;                     // largest magnitude
  double max_pitch_rad = 0;                    // largest magnitude
};

// A row of the table: name and unit as the protocol has them, and the field that holds the value.
struct MetricInfo {
  const char* name;  // ends with the unit
  const char* unit;
  std::variant<double Metrics::*, std::optional<double> Metrics::*> member;
  const char* help;

  // True if a run may have no such number.
  bool optional() const { return member.index() == 1; }
  std::optional<double> value(const Metrics& metrics) const {
    return std::visit([&](auto at) -> std::optional<double> { return metrics.*at; }, member);
  }
};

// In the order in which the protocol writes them.
inline const std::array<MetricInfo, 5> kMetrics{{
    {"elapsed_time_s", "s", &Metrics::elapsed_time_s, "time from the start of the run to its end"},
    {"distance_to_target_m", "m", &Metrics::distance_to_target_m,
     "distance in the ground plane from car to target at the end"},
    {"consumed_energy_j", "J", &Metrics::consumed_energy_j, "electrical energy drawn from the servo supply"},
    {"max_roll_rad", "rad", &Metrics::max_roll_rad, "largest magnitude of roll"},
    {"max_pitch_rad", "rad", &Metrics::max_pitch_rad, "largest magnitude of pitch"},
}};

}  // namespace foldcar
