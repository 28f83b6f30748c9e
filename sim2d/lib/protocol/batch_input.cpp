#include "batch_input.h"

#include <set>
#include <utility>

#include "printed_number.h"
#include "terrain_input.h"

namespace foldcar {
namespace {

using nlohmann::json;

ServoSpec read_servo(JsonReader reader) {
  ServoSpec servo;
  servo.stall_torque_n_m = reader.number("stall_torque_n_m");
  servo.no_load_speed_rad_s = reader.number("no_load_speed_rad_s");
  servo.rated_v = reader.number("rated_v");
  servo.stall_current_a = reader.number("stall_current_a");
  servo.no_load_current_a = reader.number("no_load_current_a", {0, servo.stall_current_a});
  servo.rotor_inertia_kg_m2 = reader.number("rotor_inertia_kg_m2");
  servo.neutral_us = reader.number("neutral_us");
  servo.deadband_us = reader.number("deadband_us");
  servo.saturation_us = reader.number("saturation_us", {servo.deadband_us + 1, reader.limits("saturation_us").maximum});
  servo.direction = reader.integer("direction");
  if (servo.direction == 0) reader.fail("direction", "must be -1 or 1");
  reader.finish();
  return servo;
}

WheelSpec read_wheel(JsonReader reader, std::size_t segments) {
  WheelSpec wheel;
  wheel.channel = reader.integer("channel");
  wheel.segment = reader.integer("segment", 0, static_cast<int>(segments) - 1);
  wheel.side = reader.choice("side", {"left", "right"}) == 0 ? CarSide::kLeft : CarSide::kRight;
  wheel.x_m = reader.number("x_m");
  wheel.radius_m = reader.number("radius_m");
  wheel.width_m = reader.number("width_m");
  wheel.mass_kg = reader.number("mass_kg");
  wheel.grip = reader.number("grip");
  wheel.eccentricity_m = reader.number("eccentricity_m", {0, 0.5 * wheel.radius_m});
  wheel.eccentricity_phase_rad = reader.number("eccentricity_phase_rad");
  wheel.servo = read_servo(reader.object("servo"));
  reader.finish();
  return wheel;
}

SegmentSpec read_segment(JsonReader reader) {
  SegmentSpec segment;
  segment.x_m = reader.number("x_m");
  segment.length_m = reader.number("length_m");
  segment.width_m = reader.number("width_m");
  segment.height_m = reader.number("height_m");
  segment.center_z_m = reader.number("center_z_m");
  segment.mass_kg = reader.number("mass_kg");
  segment.com_x_m = reader.number("com_x_m");
  segment.com_y_m = reader.number("com_y_m");
  segment.com_z_m = reader.number("com_z_m");
  segment.roll_inertia_kg_m2 = reader.number("roll_inertia_kg_m2");
  segment.pitch_inertia_kg_m2 = reader.number("pitch_inertia_kg_m2");
  segment.yaw_inertia_kg_m2 = reader.number("yaw_inertia_kg_m2");
  segment.grip = reader.number("grip");
  reader.finish();
  return segment;
}

// A hinge lies between the middles of the segments that it joins.
HingeSpec read_hinge(JsonReader reader, const SegmentSpec& front, const SegmentSpec& rear) {
  HingeSpec hinge;
  hinge.x_m = reader.number("x_m", {rear.x_m, front.x_m});
  hinge.z_m = reader.number("z_m");
  hinge.stiffness_n_m_rad = reader.number("stiffness_n_m_rad");
  hinge.damping_n_m_s_rad = reader.number("damping_n_m_s_rad");
  hinge.min_rad = reader.number("min_rad");
  hinge.max_rad = reader.number("max_rad");
  reader.finish();
  return hinge;
}

void read_segments(JsonReader& reader, BodySpec& body) {
  for (JsonReader& segment : reader.objects("segments")) {
    body.segments.push_back(read_segment(segment));
    const std::size_t j = body.segments.size() - 1;
    if (j > 0 && body.segments[j].x_m >= body.segments[j - 1].x_m) {
      reader.fail("segments", "must stand from front to back, each at a smaller x_m than the one before");
    }
  }
  const std::size_t joints = body.segments.size() - 1;
  for (JsonReader& hinge : reader.objects("hinges", joints, joints)) {
    const std::size_t j = body.hinges.size();
    body.hinges.push_back(read_hinge(hinge, body.segments[j], body.segments[j + 1]));
  }
}

// Checks that both sides have the same axles and that no output drives two wheels.
void check_wheels(const JsonReader& reader, const std::vector<WheelSpec>& wheels) {
  std::set<int> channels;
  std::multiset<std::pair<int, double>> axles[2];
  for (const WheelSpec& wheel : wheels) {
    if (!channels.insert(wheel.channel).second) {
      reader.fail("wheels", "channel " + std::to_string(wheel.channel) + " drives two wheels");
    }
    axles[static_cast<int>(wheel.side)].insert({wheel.segment, wheel.x_m});
  }
  if (axles[0] != axles[1]) {
    reader.fail("wheels", "every left wheel needs a right one at the same x_m on the same segment");
  }
}

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

// The firmware's inputs: the keys that the lines run and pulses have in common.
void read_set_point(JsonReader& reader, TrialSpec& trial) {
  trial.speed_m_s = reader.number("speed_m_s");
  trial.yaw_rate_rad_s = reader.number_or("yaw_rate_rad_s", 0);
  trial.time_limit_s = reader.number("time_limit_s");
  if (reader.has("parameters")) read_parameters(reader.object("parameters"), trial.parameters);
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
  }
  throw InputError("a line must have exactly one key: body, scene, run, heights or pulses");
}

BodySpec read_body(const json& line) {
  JsonReader reader = only_value(line, "body");
  BodySpec body;
  body.id = reader.string("id");
  read_segments(reader, body);
  body.track_m = reader.number("track_m");
  for (JsonReader& wheel : reader.objects("wheels")) {
    body.wheels.push_back(read_wheel(wheel, body.segments.size()));
  }
  check_wheels(reader, body.wheels);
  body.supply_v = reader.number("supply_v");
  reader.finish();
  return body;
}

SceneSpec read_scene(const json& line) {
  JsonReader reader = only_value(line, "scene");
  SceneSpec scene;
  scene.id = reader.string("id");
  scene.friction = reader.number("friction");
  scene.terrain = read_terrain(reader);
  scene.start = read_pose(reader.object("start"));
  if (!reader.is_null("goal")) scene.goal = read_goal(reader.object("goal"));
  scene.course = read_course(reader.object("course"));
  reader.finish();
  return scene;
}

RunLine read_run(const json& line) {
  JsonReader reader = only_value(line, "run");
  RunLine run;
  run.id = reader.string("id");
  run.body = reader.string("body");
  run.scene = reader.string("scene");
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

std::string run_id_if_any(const json& line) {
  const auto run = line.find("run");
  if (run == line.end() || !run->is_object()) return {};
  const auto id = run->find("id");
  return id != run->end() && id->is_string() ? id->get<std::string>() : std::string();
}

}  // namespace foldcar
