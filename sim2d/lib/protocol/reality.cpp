#include "reality.h"

#include <algorithm>

#include "hal.h"
#include "servo_model.h"

namespace foldcar {
namespace {

constexpr Limits kDifference{-10, 10};
constexpr Limits kFactor{0, 10};
constexpr Limits kShift_m{-2, 2};
constexpr Limits kAngle_rad{-100, 100};
// No mass or speed becomes less than this fraction of the design's.
constexpr double kMinFactor = 0.05;
// The largest eccentricity of a wheel, as a fraction of its radius.
constexpr double kMaxEccentricity = 0.4;

const std::map<std::string, Limits>& whole_car() {
  static const std::map<std::string, Limits> table = {
      // Factors.
      {"friction", kFactor},
      {"obstacle_height", kFactor},
      // Shifts.
      {"start_x_m", kShift_m},
      {"start_y_m", kShift_m},
      {"start_heading_rad", kAngle_rad},
      {"track_m", kShift_m},
      {"com_x_m", kShift_m},
      {"com_y_m", kShift_m},
      {"com_z_m", kShift_m},
      {"supply_v", {-60, 60}},
      // Differences.
      {"mass", kDifference},
      {"belly_grip", kDifference},
      // In place of the design's.
      {"supply_resistance_ohm", {0, 5}},
      {"wheel_camber_rad", {-0.3, 0.3}},
      {"tyre_contact_time_s", {0.004, 0.05}},
  };
  return table;
}

const std::map<std::string, Limits>& each_wheel() {
  static const std::map<std::string, Limits> table = {
      // Differences.
      {"wheel_radius", kDifference},
      {"tyre_grip", kDifference},
      {"servo_speed", kDifference},
      {"servo_torque", kDifference},
      // Shifts.
      {"neutral_us", {-1000, 1000}},
      {"deadband_us", {-1000, 1000}},
      // In place of the design's.
      {"eccentricity_m", {0, 0.5}},
      {"eccentricity_phase_rad", kAngle_rad},
  };
  return table;
}

// Clamps a value to the limits of the input at `path`.
double within(const std::string& path, double value) {
  const Limits limits = limits_of(path);
  return std::clamp(value, limits.minimum, limits.maximum);
}

// The differences of one car from its design, or of the wheel at a channel, by name: of() returns one, or `otherwise`
// if it is not given; scale() multiplies a value by 1 + difference, shift() adds it, both within the limits of the
// input at path.
class Differences {
 public:
  explicit Differences(const Reality& reality) : reality_(reality) {}
  Differences(const Reality& reality, int channel) : reality_(reality), channel_(channel) {}

  double of(const char* name, double otherwise = 0) const {
    if (channel_ < 0) {
      const auto found = reality_.numbers.find(name);
      return found == reality_.numbers.end() ? otherwise : found->second;
    }
    const auto found = reality_.wheels.find(name);
    return found == reality_.wheels.end() ? otherwise : found->second[static_cast<std::size_t>(channel_)];
  }
  void scale(double& value, const char* name, const std::string& path) const {
    if (const double difference = of(name); difference != 0) {
      value = within(path, value * std::max(kMinFactor, 1 + difference));
    }
  }
  void shift(double& value, const char* name, const std::string& path) const {
    if (const double shift = of(name); shift != 0) value = within(path, value + shift);
  }

 private:
  const Reality& reality_;
  int channel_ = -1;
};

// Changes a segment from its design to this car's.
void change(SegmentSpec& segment, const Differences& car) {
  const std::string place = "body.segments.";
  car.scale(segment.mass_kg, "mass", place + "mass_kg");
  car.scale(segment.roll_inertia_kg_m2, "mass", place + "roll_inertia_kg_m2");
  car.scale(segment.pitch_inertia_kg_m2, "mass", place + "pitch_inertia_kg_m2");
  car.scale(segment.yaw_inertia_kg_m2, "mass", place + "yaw_inertia_kg_m2");
  car.scale(segment.grip, "belly_grip", place + "grip");
  car.shift(segment.com_x_m, "com_x_m", place + "com_x_m");
  car.shift(segment.com_y_m, "com_y_m", place + "com_y_m");
  car.shift(segment.com_z_m, "com_z_m", place + "com_z_m");
}

// Changes a wheel and its servo from the design to this car's: `own` holds the wheel's differences, `car` the car's.
void change(WheelSpec& wheel, const Differences& car, const Differences& own) {
  const std::string place = "body.wheels.";
  own.scale(wheel.radius_m, "wheel_radius", place + "radius_m");
  own.scale(wheel.grip, "tyre_grip", place + "grip");
  if (const double eccentricity_m = own.of("eccentricity_m"); eccentricity_m > 0) {
    wheel.eccentricity_m = std::min(eccentricity_m, kMaxEccentricity * wheel.radius_m);
    wheel.eccentricity_phase_rad =
        within(place + "eccentricity_phase_rad", own.of("eccentricity_phase_rad", wheel.eccentricity_phase_rad));
  }
  wheel.camber_rad = car.of("wheel_camber_rad", wheel.camber_rad);
  wheel.contact_time_s = car.of("tyre_contact_time_s", wheel.contact_time_s);
  if (!wheel.driven()) return;
  ServoSpec& servo = wheel.servo;
  own.scale(servo.no_load_speed_rad_s, "servo_speed", place + "servo.no_load_speed_rad_s");
  own.scale(servo.stall_torque_n_m, "servo_torque", place + "servo.stall_torque_n_m");
  own.shift(servo.neutral_us, "neutral_us", place + "servo.neutral_us");
  own.shift(servo.deadband_us, "deadband_us", place + "servo.deadband_us");
  servo.saturation_us = std::max(servo.saturation_us, servo.deadband_us + 1);
}

// A height of terrain times the factor, within the limits of its kind.
void raise(double& height_m, double factor, const char* path) {
  if (factor != 1) height_m = within(std::string("scene.terrain.") + path, height_m * factor);
}

}  // namespace

std::map<std::string, Limits> reality_limits() {
  std::map<std::string, Limits> table = whole_car();
  for (const auto& [name, limits] : each_wheel()) {
    table[name] = limits;
    table[name + ".count"] = {0, static_cast<double>(kChannelCount)};
  }
  return table;
}

Reality read_reality(JsonReader reader) {
  Reality reality;
  for (const auto& [name, limits] : whole_car()) {
    if (reader.has(name.c_str())) reality.numbers[name] = reader.number(name.c_str());
  }
  for (const auto& [name, limits] : each_wheel()) {
    if (!reader.has(name.c_str())) continue;
    std::vector<double>& values = reality.wheels[name] = reader.list(name.c_str());
    if (values.size() != kChannelCount) {
      reader.fail(name, "has " + std::to_string(values.size()) + " entries, it needs one for each of " +
                            std::to_string(kChannelCount) + " channels");
    }
  }
  reader.finish();
  return reality;
}

std::pair<double, double> ground_factors(const Reality& reality) {
  const Differences ground(reality);
  return {ground.of("friction", 1), ground.of("obstacle_height", 1)};
}

// Returns the body as this car really is. Throws InputError if the supply's resistance is too large for its servos.
BodySpec real_body(BodySpec body, const Reality& reality) {
  const Differences car(reality);
  for (SegmentSpec& segment : body.segments) change(segment, car);
  for (WheelSpec& wheel : body.wheels) change(wheel, car, Differences(reality, wheel.channel));
  car.shift(body.track_m, "track_m", "body.track_m");
  car.shift(body.supply_v, "supply_v", "body.supply_v");
  body.supply_resistance_ohm = car.of("supply_resistance_ohm", body.supply_resistance_ohm);
  const double largest_ohm = largest_supply_resistance_ohm(body);
  if (body.supply_resistance_ohm > largest_ohm) {
    throw InputError("reality.supply_resistance_ohm: " + nlohmann::json(body.supply_resistance_ohm).dump() +
                     " is above the limit " + nlohmann::json(largest_ohm).dump());
  }
  return body;
}

// Returns the scene as it really is: friction and heights of the terrain scaled, the start shifted.
SceneSpec real_scene(SceneSpec scene, const Reality& reality) {
  const Differences ground(reality);
  const auto [friction, height] = ground_factors(reality);
  if (friction != 1) {
    scene.friction = within("scene.friction", scene.friction * friction);
    for (PatchSpec& patch : scene.terrain.patches) {
      patch.friction = within("scene.terrain.patch.friction", patch.friction * friction);
    }
  }
  for (BlockSpec& block : scene.terrain.blocks) {
    raise(block.height_m, height, "box.height_m");
    // Higher than half its chord it would be no arc.
    if (block.kind == BlockSpec::Kind::kHalfRound) block.height_m = std::min(block.height_m, 0.5 * block.length_m);
  }
  for (HillSpec& hill : scene.terrain.hills) raise(hill.height_m, height, "hill.height_m");
  for (PotholeSpec& pothole : scene.terrain.potholes) raise(pothole.depth_m, height, "pothole.depth_m");
  for (RoughSpec& rough : scene.terrain.roughs) raise(rough.height_sd_m, height, "rough.height_sd_m");
  ground.shift(scene.start.x_m, "start_x_m", "scene.start.x_m");
  ground.shift(scene.start.y_m, "start_y_m", "scene.start.y_m");
  ground.shift(scene.start.heading_rad, "start_heading_rad", "scene.start.heading_rad");
  return scene;
}

}  // namespace foldcar
