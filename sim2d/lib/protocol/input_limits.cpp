#include "input_limits.h"

#include <stdexcept>

#include "ground_outline.h"
#include "hal.h"
#include "reality.h"
#include "scene_terrain.h"
#include "supervisor.h"
#include "terrain_input.h"

namespace foldcar {
namespace {

using Table = std::map<std::string, Limits>;

// Limits of what the model can stand for. Lengths below a millimetre vanish in its contacts, cars beyond a metre or so
// are another machine; the rest keeps the arithmetic in single precision healthy.
constexpr Limits kCarLength_m{0.005, 2};
constexpr Limits kOffset_m{-1, 1};
constexpr Limits kMass_kg{0.0005, 50};
constexpr Limits kInertia_kg_m2{1e-7, 50};
constexpr Limits kFriction{0, 5};
constexpr Limits kGrip{0, 5};
constexpr Limits kVoltage_v{0.1, 60};
constexpr Limits kCurrent_a{0, 50};
constexpr Limits kPulse_us{500, 2500};
constexpr double kFold_rad = 3;  // a hinge folds less than half a turn
constexpr Limits kTime_s{0, 3600};

void add_body(Table& table) {
  const double channels = static_cast<double>(kChannelCount);
  for (const char* key : {"x_m", "center_z_m", "com_x_m", "com_y_m", "com_z_m"}) {
    table[std::string("body.segments.") + key] = kOffset_m;
  }
  for (const char* key : {"length_m", "width_m", "height_m"}) {
    table[std::string("body.segments.") + key] = kCarLength_m;
  }
  for (const char* key : {"roll_inertia_kg_m2", "pitch_inertia_kg_m2", "yaw_inertia_kg_m2"}) {
    table[std::string("body.segments.") + key] = kInertia_kg_m2;
  }
  table.insert({{"body.segments.count", {1, 8}},
                {"body.segments.mass_kg", kMass_kg},
                {"body.segments.grip", kGrip},
                {"body.hinges.z_m", kOffset_m},
                // A hinge softer than any film would be none; a stiffer one is a rigid beam.
                {"body.hinges.stiffness_n_m_rad", {1e-6, 1000}},
                {"body.hinges.damping_n_m_s_rad", {0, 10}},
                {"body.hinges.min_rad", {-kFold_rad, 0}},
                {"body.hinges.max_rad", {0, kFold_rad}},
                {"body.track_m", kCarLength_m},
                {"body.supply_v", kVoltage_v},
                {"body.wheels.count", {2, channels}},
                {"body.wheels.channel", {0, channels - 1}},
                {"body.wheels.x_m", kOffset_m},
                {"body.wheels.radius_m", {0.005, 0.5}},
                {"body.wheels.width_m", {0.0005, 0.2}},
                {"body.wheels.mass_kg", kMass_kg},
                {"body.wheels.grip", kGrip},
                {"body.wheels.eccentricity_phase_rad", kHeading_rad},
                {"body.wheels.camber_rad", {-0.3, 0.3}},
                // MuJoCo takes no less than two of its steps; softer tyres would sink in by millimetres.
                {"body.wheels.contact_time_s", {0.004, 0.05}},
                {"body.wheels.servo.stall_torque_n_m", {1e-4, 50}},
                {"body.wheels.servo.no_load_speed_rad_s", {0.1, 200}},
                {"body.wheels.servo.rated_v", kVoltage_v},
                {"body.wheels.servo.stall_current_a", kCurrent_a},
                {"body.wheels.servo.rotor_inertia_kg_m2", {0, kInertia_kg_m2.maximum}},
                {"body.wheels.servo.neutral_us", kPulse_us},
                {"body.wheels.servo.deadband_us", {0, 500}},
                {"body.wheels.servo.saturation_us", {1, 1000}},
                {"body.wheels.servo.direction", {-1, 1}}});
}

void add_scene(Table& table) {
  for (const char* place : {"scene.start", "scene.goal"}) {
    table[std::string(place) + ".x_m"] = table[std::string(place) + ".y_m"] = kCoordinate_m;
    table[std::string(place) + ".heading_rad"] = kHeading_rad;
  }
  for (const char* side : {"x_min_m", "x_max_m", "y_min_m", "y_max_m"}) {
    table[std::string("scene.course.") + side] = kCoordinate_m;
  }
  table["scene.friction"] = kFriction;
  table["scene.program.time_limit_s"] = kTime_s;
  table["scene.program.step_s"] = {1.0 / 240 - 1e-9, 60};
  table["scene.goal.radius_m"] = {0.001, 1000};
}

void add_terrain(Table& table) {
  table.insert({{"scene.terrain.count", {0, 10000}},
                // Of the smooth ground that a car stands over, found during a run.
                {"scene.terrain.heights", {0, kMostHeights}},
                // Likewise of the blocks.
                {"scene.terrain.faces", {0, kMostFaces}}});
  for (const auto& [path, limits] : terrain_limits()) table["scene.terrain." + path] = limits;
}

void add_runs(Table& table) {
  table.insert({{"run.speed_m_s", {-kSpeedLimitMS, kSpeedLimitMS}},
                {"run.yaw_rate_rad_s", {-kYawRateLimitRadS, kYawRateLimitRadS}},
                {"run.time_limit_s", {0.001, kTime_s.maximum}},
                {"run.path_interval_s", kTime_s},
                {"heights.x_m", kCoordinate_m},
                {"heights.y_m", kCoordinate_m},
                {"heights.x_m.count", {0, 1e6}},
                {"heights.y_m.count", {0, 1e6}},
                {"advance.to_s", kTime_s}});
  for (const auto& [name, limits] : reality_limits()) table["reality." + name] = limits;
}

Table made() {
  Table table;
  add_body(table);
  add_scene(table);
  add_terrain(table);
  add_runs(table);
  return table;
}

}  // namespace

const Table& input_limits() {
  static const Table table = made();
  return table;
}

Limits limits_of(const std::string& path) {
  const auto row = input_limits().find(path);
  if (row == input_limits().end()) throw std::logic_error("no limits of " + path);
  return row->second;
}

}  // namespace foldcar
