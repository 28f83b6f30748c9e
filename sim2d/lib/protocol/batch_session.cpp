#include "batch_session.h"

#include "printed_number.h"
#include "pulse_record.h"
#include "trial.h"
#include "trial_start.h"

namespace foldcar {

using nlohmann::ordered_json;

std::string one_line(const ordered_json& value) {
  return value.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

namespace {

std::string result_reply(const RunLine& run, const TrialResult& result) {
  ordered_json reply = {{"run", run.id}};
  reply.update(result_object(result));
  if (run.trial.path_interval_s > 0) reply["path"] = result.path;
  return one_line(reply);
}

std::string pulses_reply(const PulsesLine& pulses, double step_s) {
  ordered_json changes = ordered_json::array();
  for (const PulseChange& change : record_pulses(pulses.trial, step_s)) {
    ordered_json row = {change.t_s};
    for (const float pulse_us : change.pulses_us) row.push_back(as_printed(pulse_us));
    changes.push_back(std::move(row));
  }
  return one_line({{"pulses", pulses.id}, {"changes", changes}});
}

}  // namespace

namespace {

// The at-th recorded value as JSON: the record's constant, or a vector, truth or number.
ordered_json recorded_value(const Recorded& recorded, std::size_t at) {
  if (!recorded.record->constant.empty()) return ordered_json::parse(recorded.record->constant);
  const RecordedValue& value = recorded.values[at];
  if (recorded.record->value.vector) return value;
  return recorded.record->value.truth ? ordered_json(value[0] != 0) : ordered_json(value[0]);
}

ordered_json recorded_object(const Recorded& recorded) {
  if (recorded.record->kind != RecordSpec::Kind::kSeries) {
    const char* kind = recorded.record->kind == RecordSpec::Kind::kInitial ? "initial" : "final";
    return {{"kind", kind}, {"value", recorded_value(recorded, 0)}};
  }
  ordered_json rows = ordered_json::array();
  for (std::size_t at = 0; at < recorded.values.size(); ++at) {
    rows.push_back({recorded.times_s[at], recorded_value(recorded, at)});
  }
  return {{"kind", "series"}, {"value", std::move(rows)}};
}

}  // namespace

nlohmann::ordered_json result_object(const TrialResult& result) {
  ordered_json object = {{"outcome", text(result.outcome)}};
  for (const MetricInfo& metric : kMetrics) {
    const std::optional<double> value = metric.value(result);
    object[metric.name] = value ? ordered_json(*value) : ordered_json(nullptr);
  }
  for (const Recorded& recorded : result.recorded) {
    object["recorded"][recorded.record->name] = recorded_object(recorded);
  }
  return object;
}

std::string error_reply(std::size_t line_number, const std::string& run_id, ErrorKind kind,
                        const std::string& message) {
  const char* kind_text = kind == ErrorKind::kInput ? "input" : "simulation";
  ordered_json error = {{"line", line_number}, {"run", nullptr}, {"kind", kind_text}, {"message", message}};
  if (!run_id.empty()) error["run"] = run_id;
  return one_line({{"error", error}});
}

// Handles one input line. Bodies and scenes are kept and have no reply; every other line has one, if only an error.
std::optional<std::string> BatchSession::answer(std::size_t line_number, const std::string& line) {
  std::string run_id;
  try {
    const nlohmann::json parsed = parse_object(line);
    run_id = run_id_if_any(parsed);
    switch (line_kind(parsed)) {
      case LineKind::kBody: {
        BodySpec body = read_body(parsed);
        const std::string id = body.id;
        bodies_.insert_or_assign(id, std::move(body));
        return std::nullopt;
      }
      case LineKind::kScene: {
        SceneSpec scene = read_scene(parsed);
        const std::string id = scene.id;
        if (id == terrain_of_) terrain_.reset();
        scenes_.insert_or_assign(id, std::move(scene));
        return std::nullopt;
      }
      case LineKind::kRun:
        return run(read_run(parsed));
      case LineKind::kHeights:
        return heights(read_heights(parsed));
      case LineKind::kPulses:
        return pulses_reply(read_pulses(parsed), engine_.step_s());
      case LineKind::kMjcf:
        return mjcf(read_mjcf(parsed));
    }
    return std::nullopt;
  } catch (const InputError& error) {
    return error_reply(line_number, run_id, ErrorKind::kInput, error.what());
  } catch (const std::exception& error) {
    return error_reply(line_number, run_id, ErrorKind::kSimulation, error.what());
  }
}

std::string BatchSession::run(const RunLine& run) {
  const BodySpec car = real_body(body("run", run.body), run.reality);
  const SceneSpec in = real_scene(scene("run", run.scene), run.reality);
  const TrialResult result =
      run_trial(engine_, car, in, run.trial, timed_ ? &stopwatch_ : nullptr, &terrain(in, run.reality));
  simulated_s_ += kSettling_s + result.elapsed_time_s;
  return result_reply(run, result);
}

std::string BatchSession::heights(const HeightsLine& heights) {
  const SceneSpec in = real_scene(scene("heights", heights.scene), heights.reality);
  const SceneTerrain& ground = terrain(in, heights.reality);
  std::vector<double> z_m, friction;
  for (std::size_t i = 0; i < heights.x_m.size(); ++i) {
    z_m.push_back(ground.height_m(heights.x_m[i], heights.y_m[i]));
    friction.push_back(ground.friction(heights.x_m[i], heights.y_m[i], in.friction));
  }
  return one_line({{"heights", heights.id}, {"z_m", z_m}, {"friction", friction}});
}

std::string BatchSession::mjcf(const MjcfLine& mjcf) {
  const BodySpec car = real_body(body("mjcf", mjcf.body), mjcf.reality);
  const SceneSpec in = real_scene(scene("mjcf", mjcf.scene), mjcf.reality);
  return one_line({{"mjcf", mjcf.id}, {"xml", engine_.mjcf(car, in, terrain(in, mjcf.reality), mjcf.id)}});
}

const BodySpec& BatchSession::body(const char* line, const std::string& id) const {
  const auto found = bodies_.find(id);
  if (found == bodies_.end()) throw InputError(std::string(line) + ".body: no body \"" + id + "\" on an earlier line");
  return found->second;
}

const SceneSpec& BatchSession::scene(const char* line, const std::string& id) const {
  const auto found = scenes_.find(id);
  if (found == scenes_.end()) throw InputError(std::string(line) + ".scene: no scene \"" + id + "\" on an earlier line");
  return found->second;
}

// Returns the scene's terrain. The last one made is kept, because making it takes long and runs often share it.
const SceneTerrain& BatchSession::terrain(const SceneSpec& scene, const Reality& reality) {
  const std::pair<double, double> factors = ground_factors(reality);
  if (!terrain_ || terrain_of_ != scene.id || terrain_factors_ != factors) {
    terrain_.emplace(scene.terrain);
    terrain_of_ = scene.id;
    terrain_factors_ = factors;
  }
  return *terrain_;
}

}  // namespace foldcar
