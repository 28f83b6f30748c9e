// The input of `carsim batch`, as docs/carsim.md describes it: lines to specs, checked.
#pragma once

#include <string>
#include <vector>

#include "body_spec.h"
#include "json_reader.h"
#include "reality.h"
#include "scene_spec.h"
#include "trial.h"

namespace foldcar {

// The kinds of input line.
enum class LineKind { kBody, kScene, kRun, kHeights, kPulses, kMjcf };

// Which kind a parsed line is. InputError if it is none or has more than one key.
LineKind line_kind(const nlohmann::json& line);

// A trial to simulate, with the ids of its body and scene and what the real ones differ in from them.
struct RunLine {
  std::string id;
  std::string body;
  std::string scene;
  Reality reality;
  TrialSpec trial;
};

// Points of a scene whose ground's height and friction are wanted.
struct HeightsLine {
  std::string id;
  std::string scene;
  Reality reality;
  std::vector<double> x_m;
  std::vector<double> y_m;
};

// A trial whose servo pulses are asked for.
struct PulsesLine {
  std::string id;
  TrialSpec trial;
};

// A car in a scene as MuJoCo's XML; the model is named by the id.
struct MjcfLine {
  std::string id;
  std::string body;
  std::string scene;
  Reality reality;
};

// The line's only value, checked in full. All throw InputError.
BodySpec read_body(const nlohmann::json& line);
SceneSpec read_scene(const nlohmann::json& line);
RunLine read_run(const nlohmann::json& line);
HeightsLine read_heights(const nlohmann::json& line);
PulsesLine read_pulses(const nlohmann::json& line);
MjcfLine read_mjcf(const nlohmann::json& line);

// The id of a run line that may be wrong otherwise; empty if it has none.
std::string run_id_if_any(const nlohmann::json& line);

}  // namespace foldcar
