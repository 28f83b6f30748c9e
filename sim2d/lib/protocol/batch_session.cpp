#include "batch_session.h"

#include "printed_number.h"
#include "pulse_record.h"
#include "trial.h"

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

std::string pulses_reply(const PulsesLine& pulses) {
  ordered_json changes = ordered_json::array();
  for (const PulseChange& change : record_pulses(pulses.trial)) {
    ordered_json row = {change.t_s};
    for (const float pulse_us : change.pulses_us) row.push_back(as_printed(pulse_us));
    changes.push_back(std::move(row));
  }
  return one_line({{"pulses", pulses.id}, {"changes", changes}});
}

}  // namespace

nlohmann::ordered_json result_object(const TrialResult& result) {
  ordered_json object = {{"outcome", text(result.outcome)},
                         {"elapsed_time_s", result.elapsed_time_s},
                         {"distance_to_target_m", nullptr},
                         {"consumed_energy_j", result.consumed_energy_j},
                         {"max_roll_rad", result.max_roll_rad},
                         {"max_pitch_rad", result.max_pitch_rad}};
  if (result.distance_to_target_m) object["distance_to_target_m"] = *result.distance_to_target_m;
  return object;
}

std::string error_reply(std::size_t line_number, const std::string& run_id, ErrorKind kind,
                        const std::string& message) {
  const char* kind_text = kind == ErrorKind::kInput ? "input" : "simulation";
  ordered_json error = {{"line", line_number}, {"run", nullptr}, {"kind", kind_text}, {"message", message}};
  if (!run_id.empty()) error["run"] = run_id;
  return one_line({{"error", error}});
}

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
        scenes_.insert_or_assign(id, std::move(scene));
        return std::nullopt;
      }
      case LineKind::kRun:
        return run(read_run(parsed));
      case LineKind::kPulses:
        return pulses_reply(read_pulses(parsed));
    }
    return std::nullopt;
  } catch (const InputError& error) {
    return error_reply(line_number, run_id, ErrorKind::kInput, error.what());
  } catch (const std::exception& error) {
    return error_reply(line_number, run_id, ErrorKind::kSimulation, error.what());
  }
}

std::string BatchSession::run(const RunLine& run) {
  const auto body = bodies_.find(run.body);
  if (body == bodies_.end()) throw InputError("run.body: no body \"" + run.body + "\" on an earlier line");
  const auto scene = scenes_.find(run.scene);
  if (scene == scenes_.end()) throw InputError("run.scene: no scene \"" + run.scene + "\" on an earlier line");
  const TrialResult result =
      run_trial(body->second, scene->second, run.trial, StepOptions{}, timed_ ? &stopwatch_ : nullptr);
  simulated_s_ += result.elapsed_time_s;
  return result_reply(run, result);
}

}  // namespace foldcar
