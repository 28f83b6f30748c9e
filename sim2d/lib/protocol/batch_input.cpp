#include "batch_input.h"

#include "body_input.h"
#include "printed_number.h"
#include "program_input.h"
#include "terrain_input.h"

namespace foldcar {
namespace {

using nlohmann::json;

PoseSpec read_pose(JsonReader reader) {
  PoseSpec pose;
  pose.x_m = reader.number("x_m");
  pose.y_m = reader.number("y_m");
  pose.heading_rad = reader.number("heading_rad");
  reader.finish();
  return pose;
}

GoalSpec read_goal(JsonReader reader) {
  GoalSpec goal;
  goal.kind = reader.choice("kind", {"line", "disc"}) == 0 ? GoalSpec::Kind::kLine : GoalSpec::Kind::kDisc;
  goal.x_m = reader.number("x_m");
  goal.y_m = reader.number("y_m");
  if (goal.kind == GoalSpec::Kind::kLine) {
    goal.heading_rad = reader.number("heading_rad");
  } else {
    goal.radius_m = reader.number("radius_m");
  }
  reader.finish();
  return goal;
}

CourseSpec read_course(JsonReader reader) {
  CourseSpec course;
  course.x_min_m = reader.number("x_min_m");
  course.x_max_m = reader.number("x_max_m", {course.x_min_m, reader.limits("x_max_m").maximum});
  course.y_min_m = reader.number("y_min_m");
  course.y_max_m = reader.number("y_max_m", {course.y_min_m, reader.limits("y_max_m").maximum});
  reader.finish();
  return course;
}

// Sets the firmware's parameters. An unknown name or a value outside its limits is an error, with the limits in its
// text.
void read_parameters(JsonReader reader, Parameters& parameters) {
  for (const auto& [name, value] : reader.numbers()) {
    const SetResult result = parameters.set(name.c_str(), static_cast<float>(value));
    if (result == SetResult::kOk) continue;
    std::string problem = text(result);
    if (const auto known = find_parameter(name.c_str())) {
      const ParameterInfo& info = parameter_info(*known);
      problem.insert(0, json(value).dump() + " ");
      problem += " (" + json(as_printed(info.minimum)).dump() + " to " + json(as_printed(info.maximum)).dump() + ")";
    }
    reader.fail(name, problem);
  }
}

// Reads the keys that the lines run and pulses have in common: set-point, time limit and parameters of the firmware.
void read_set_point(JsonReader& reader, TrialSpec& trial) {
  trial.speed_m_s = reader.number("speed_m_s");
  trial.yaw_rate_rad_s = reader.number_or("yaw_rate_rad_s", 0);
  trial.time_limit_s = reader.number("time_limit_s");
  if (reader.has("parameters")) read_parameters(reader.object("parameters"), trial.parameters);
}

Reality read_reality_of(JsonReader& reader, const std::string& line) {
  if (!reader.has("reality")) return {};
  return read_reality(JsonReader(reader.value("reality"), line + ".reality", "reality"));
}

JsonReader only_value(const json& line, const char* kind) { return JsonReader(line.at(kind), kind); }

}  // namespace

LineKind line_kind(const json& line) {
  if (line.size() == 1) {
    if (line.contains("body")) return LineKind::kBody;
    if (line.contains("scene")) return LineKind::kScene;
    if (line.contains("run")) return LineKind::kRun;
    if (line.contains("heights")) return LineKind::kHeights;
    if (line.contains("pulses")) return LineKind::kPulses;
    if (line.contains("mjcf")) return LineKind::kMjcf;
  }
  throw InputError("a line must have exactly one key: body, scene, run, heights, pulses or mjcf");
}

BodySpec read_body(const json& line) { return read_body(only_value(line, "body")); }

SceneSpec read_scene(const json& line) {
  JsonReader reader = only_value(line, "scene");
  SceneSpec scene;
  scene.id = reader.string("id");
  scene.friction = reader.number("friction");
  scene.terrain = read_terrain(reader);
  scene.start = read_pose(reader.object("start"));
  if (!reader.is_null("goal")) scene.goal = read_goal(reader.object("goal"));
  scene.course = read_course(reader.object("course"));
  if (reader.has("program")) scene.program = read_program(reader.object("program"));
  reader.finish();
  return scene;
}

RunLine read_run(const json& line) {
  JsonReader reader = only_value(line, "run");
  RunLine run;
  run.id = reader.string("id");
  run.body = reader.string("body");
  run.scene = reader.string("scene");
  run.reality = read_reality_of(reader, "run");
  read_set_point(reader, run.trial);
  run.trial.path_interval_s = reader.number_or("path_interval_s", 0);
  reader.finish();
  return run;
}

HeightsLine read_heights(const json& line) {
  JsonReader reader = only_value(line, "heights");
  HeightsLine heights;
  heights.id = reader.string("id");
  heights.scene = reader.string("scene");
  heights.reality = read_reality_of(reader, "heights");
  heights.x_m = reader.list("x_m");
  heights.y_m = reader.list("y_m");
  if (heights.x_m.size() != heights.y_m.size()) {
    reader.fail("y_m", "has " + std::to_string(heights.y_m.size()) + " entries, x_m has " +
                           std::to_string(heights.x_m.size()));
  }
  reader.finish();
  return heights;
}

PulsesLine read_pulses(const json& line) {
  // Its numbers are those of a run.
  JsonReader reader(line.at("pulses"), "pulses", "run");
  PulsesLine pulses;
  pulses.id = reader.string("id");
  read_set_point(reader, pulses.trial);
  reader.finish();
  return pulses;
}

MjcfLine read_mjcf(const json& line) {
  JsonReader reader = only_value(line, "mjcf");
  MjcfLine mjcf{reader.string("id"), reader.string("body"), reader.string("scene"), read_reality_of(reader, "mjcf")};
  reader.finish();
  return mjcf;
}

std::string run_id_if_any(const json& line) {
  const auto run = line.find("run");
  if (run == line.end() || !run->is_object()) return {};
  const auto id = run->find("id");
  return id != run->end() && id->is_string() ? id->get<std::string>() : std::string();
}

}  // namespace foldcar
