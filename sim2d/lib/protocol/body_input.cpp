#include "body_input.h"

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "servo_model.h"

namespace foldcar {
namespace {

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
  wheel.camber_rad = reader.number_or("camber_rad", wheel.camber_rad);
  wheel.contact_time_s = reader.number_or("contact_time_s", wheel.contact_time_s);
  if (reader.has("servo")) wheel.servo = read_servo(reader.object("servo"));
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

}  // namespace

BodySpec read_body(JsonReader reader) {
  BodySpec body;
  body.id = reader.string("id");
  read_segments(reader, body);
  body.track_m = reader.number("track_m");
  for (JsonReader& wheel : reader.objects("wheels")) {
    body.wheels.push_back(read_wheel(wheel, body.segments.size()));
  }
  check_wheels(reader, body.wheels);
  body.supply_v = reader.number("supply_v");
  if (reader.has("supply_resistance_ohm")) {
    body.supply_resistance_ohm = reader.number("supply_resistance_ohm", {0, largest_supply_resistance_ohm(body)});
  }
  reader.finish();
  return body;
}

}  // namespace foldcar
