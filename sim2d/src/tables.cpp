#include "tables.h"

#include "build_id.h"
#include "built_engine.h"
#include "ending.h"
#include "firmware_id.h"
#include "input_limits.h"
#include "metrics.h"
#include "parameter_table.h"
#include "printed_number.h"
#include "trial_start.h"

namespace foldcar {
namespace {

const char* text(ParameterKind kind) {
  switch (kind) {
    case ParameterKind::kInteger: return "integer";
    case ParameterKind::kSign: return "sign";
    case ParameterKind::kReal: break;
  }
  return "real";
}

}  // namespace

nlohmann::ordered_json parameters_object() {
  nlohmann::ordered_json table = nlohmann::ordered_json::array();
  for (const ParameterInfo& info : parameter_table()) {
    table.push_back({{"name", info.name},
                     {"unit", info.unit},
                     {"kind", text(info.kind)},
                     {"minimum", as_printed(info.minimum)},
                     {"maximum", as_printed(info.maximum)},
                     {"default", as_printed(info.default_value)},
                     {"help", info.help}});
  }
  return table;
}

nlohmann::ordered_json metrics_object() {
  nlohmann::ordered_json table = nlohmann::ordered_json::array();
  for (const MetricInfo& metric : kMetrics) {
    table.push_back({{"name", metric.name},
                     {"unit", metric.unit},
                     {"optional", metric.optional()},
                     {"help", metric.help}});
  }
  return table;
}

nlohmann::ordered_json limits_object() {
  nlohmann::ordered_json input = nlohmann::ordered_json::object();
  for (const auto& [path, limits] : input_limits()) input[path] = {limits.minimum, limits.maximum};
  const nlohmann::ordered_json trial = {{"settling_s", kSettling_s},
                                        {"step_s", engine().step_s()},
                                        {"firmware_tick_s", kTickUs * 1e-6},
                                        {"tipped_up", kTippedUp},
                                        {"stuck_distance_m", kStuckDistance_m},
                                        {"stuck_turn_rad", kStuckTurn_rad},
                                        {"stuck_time_s", kStuckTime_s}};
  return {{"input", input}, {"trial", trial}};
}

nlohmann::ordered_json version_object() {
  return {{"program", "carsim"}, {"build", FOLDCAR_BUILD_ID}, {"firmware", FOLDCAR_FIRMWARE_ID},
          {"engine", engine().name()}};
}

}  // namespace foldcar
