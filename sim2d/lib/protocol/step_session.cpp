#include "step_session.h"

#include "batch_input.h"
#include "batch_session.h"

namespace foldcar {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr int kMostRows = 3600 * 1000;

// A row: time, x, y, z, heading, pitch, roll, speed, yaw rate, energy consumed; SI units.
ordered_json state_row(const Snapshot& at) {
  const CarState& car = at.car;
  return {at.elapsed_time_s, car.x_m,        car.y_m,       car.z_m,           car.heading_rad,
          car.pitch_rad,     car.roll_rad,   car.speed_m_s, car.yaw_rate_rad_s, at.consumed_energy_j};
}

// Looks up a body or scene of an earlier line by its id. Throws InputError if there was no such line.
template <typename Spec>
std::shared_ptr<const Spec> find(const std::unordered_map<std::string, std::shared_ptr<const Spec>>& known,
                                 const char* kind, const std::string& id) {
  const auto found = known.find(id);
  if (found != known.end()) return found->second;
  throw InputError(std::string("run.") + kind + ": no " + kind + " \"" + id + "\" on an earlier line");
}

}  // namespace

std::optional<std::string> StepSession::answer(std::size_t line_number, const std::string& line) {
  std::string run_id;
  try {
    const json parsed = parse_object(line);
    run_id = run_id_if_any(parsed);
    const std::string kind = parsed.size() == 1 ? parsed.begin().key() : "";
    if (kind == "body") {
      const auto body = std::make_shared<const BodySpec>(read_body(parsed));
      bodies_.insert_or_assign(body->id, body);
      return std::nullopt;
    }
    if (kind == "scene") {
      const auto scene = std::make_shared<const SceneSpec>(read_scene(parsed));
      scenes_.insert_or_assign(scene->id, scene);
      return std::nullopt;
    }
    if (kind == "run") return one_line(start(parsed));
    if (kind == "advance") return one_line(advance(parsed));
    if (kind == "rows") return one_line(rows(parsed));
    if (kind == "end") return one_line(end(parsed));
    throw InputError("a line must have exactly one key: body, scene, run, advance, rows or end");
  } catch (const InputError& error) {
    return error_reply(line_number, run_id, ErrorKind::kInput, error.what());
  } catch (const std::exception& error) {
    trial_.reset();
    return error_reply(line_number, run_id, ErrorKind::kSimulation, error.what());
  }
}

ordered_json StepSession::start(const json& line) {
  const RunLine run = read_run(line);
  const auto body = find(bodies_, "body", run.body);
  const auto scene = find(scenes_, "scene", run.scene);
  trial_.reset();
  body_ = std::make_shared<const BodySpec>(real_body(*body, run.reality));
  scene_ = std::make_shared<const SceneSpec>(real_scene(*scene, run.reality));
  trial_ = std::make_unique<Trial>(engine_, *body_, *scene_, run.trial);
  advanced_ = {trial_->now()};
  return state_reply();
}

ordered_json StepSession::advance(const json& line) {
  JsonReader reader(line.at("advance"), "advance");
  const double to_s = reader.number("to_s");
  reader.finish();
  Trial& current = trial("advance");
  advanced_.clear();
  // Ends at the step whose time is nearest to to_s.
  while (!current.outcome() && current.now().elapsed_time_s + current.step_s() / 2 < to_s) {
    current.step();
    advanced_.push_back(current.now());
  }
  if (advanced_.empty()) advanced_.push_back(current.now());
  return state_reply();
}

ordered_json StepSession::rows(const json& line) const {
  JsonReader(line.at("rows"), "rows").finish();
  trial("rows");
  ordered_json rows = ordered_json::array();
  for (const Snapshot& at : advanced_) rows.push_back(state_row(at));
  return {{"rows", std::move(rows)}};
}

// Ends the trial at one of the rows of the last advance: its result is that of this row.
ordered_json StepSession::end(const json& line) {
  JsonReader reader(line.at("end"), "end");
  const int row = reader.integer("row", 0, kMostRows);
  reader.finish();
  trial("end");
  const auto index = static_cast<std::size_t>(row);
  if (index >= advanced_.size()) {
    reader.fail("row", std::to_string(row) + " is above the limit " + std::to_string(advanced_.size() - 1));
  }
  ordered_json reply = {{"result", result_object(result_at(advanced_[index], Outcome::kTerminated))}};
  trial_.reset();
  return reply;
}

ordered_json StepSession::state_reply() const {
  ordered_json reply = {{"state", state_row(trial_->now())}, {"result", nullptr}};
  if (trial_->outcome()) reply["result"] = result_object(result_at(trial_->now(), *trial_->outcome()));
  return reply;
}

Trial& StepSession::trial(const char* line_kind) const {
  if (trial_ == nullptr) throw InputError(std::string(line_kind) + ": no trial is under way: a run line starts one");
  return *trial_;
}

}  // namespace foldcar
