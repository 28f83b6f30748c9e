// What carsim tells about itself as JSON: `carsim params`, `metrics`, `limits` and `--version`.
#pragma once

#include <nlohmann/json.hpp>

namespace foldcar {

// The firmware's parameters.
nlohmann::ordered_json parameters_object();
// The numbers of a run's result.
nlohmann::ordered_json metrics_object();
// The limits of input numbers, and the rules of a trial.
nlohmann::ordered_json limits_object();
// The build, which changes whenever results can, firmware and engine.
nlohmann::ordered_json version_object();

}  // namespace foldcar
