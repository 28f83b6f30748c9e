// Lines of carsim's input, for tests: a hinged car "b", a scene "s" with one box, and a run "r" of 0.2 s.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace foldcar {

using nlohmann::json;

inline json body() {
  json line = json::parse(R"({"body": {"id": "b", "segments": [], "wheels": [], "track_m": 0.111, "supply_v": 5.2,
    "supply_resistance_ohm": 0.0, "hinges": [{"x_m": 0.0, "z_m": 0.0, "stiffness_n_m_rad": 0.02,
    "damping_n_m_s_rad": 1e-4, "min_rad": -1.0, "max_rad": 1.0}]}})");
  json segment = json::parse(R"({"length_m": 0.1, "width_m": 0.095, "height_m": 0.05, "center_z_m": 0.0, "mass_kg": 0.09,
    "com_y_m": 0.0, "com_z_m": 0.004, "roll_inertia_kg_m2": 1e-4, "pitch_inertia_kg_m2": 1e-4,
    "yaw_inertia_kg_m2": 1.4e-4, "grip": 0.58})");
  for (const double x_m : {0.051, -0.051}) {
    segment["x_m"] = segment["com_x_m"] = x_m;
    line["body"]["segments"].push_back(segment);
  }
  json wheel = json::parse(R"({"radius_m": 0.06, "width_m": 0.012, "mass_kg": 0.012, "grip": 1.0, "eccentricity_m": 0.0,
    "eccentricity_phase_rad": 0.0, "camber_rad": 0.0, "contact_time_s": 0.005,
    "servo": {"stall_torque_n_m": 0.134, "no_load_speed_rad_s": 11.5, "rated_v": 5.2, "stall_current_a": 0.7,
    "no_load_current_a": 0.11, "rotor_inertia_kg_m2": 2e-4, "neutral_us": 1500, "deadband_us": 45,
    "saturation_us": 200}})");
  for (int i = 0; i < 4; ++i) {
    wheel["channel"] = i;
    wheel["segment"] = i < 2 ? 0 : 1;
    wheel["x_m"] = i < 2 ? 0.07 : -0.07;
    wheel["side"] = i % 2 == 0 ? "left" : "right";
    wheel["servo"]["direction"] = i % 2 == 0 ? 1 : -1;
    line["body"]["wheels"].push_back(wheel);
  }
  return line;
}

inline json scene() {
  return json::parse(R"({"scene": {"id": "s", "friction": 0.6, "terrain": [{"kind": "box", "x_m": 0.45, "y_m": 0.05,
    "length_m": 0.23, "width_m": 0.23, "height_m": 0.0215, "heading_rad": 0.0}],
    "start": {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0},
    "goal": {"kind": "line", "x_m": 1.3, "y_m": 0.0, "heading_rad": 0.0},
    "course": {"x_min_m": -0.5, "x_max_m": 2.0, "y_min_m": -1.0, "y_max_m": 1.0}}})");
}

inline json run() {
  return json::parse(R"({"run": {"id": "r", "body": "b", "scene": "s", "speed_m_s": 0.6, "yaw_rate_rad_s": 0.0,
    "time_limit_s": 0.2, "parameters": {"TRACK_M": 0.111}, "path_interval_s": 0.05}})");
}

inline bool refuses(const json& reply, const std::string& words) {
  return reply.contains("error") && reply["error"]["message"].get<std::string>().find(words) != std::string::npos;
}

}  // namespace foldcar
