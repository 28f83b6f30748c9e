// A batch in one process: takes input lines one by one, remembers bodies and scenes, runs the trials.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include "batch_input.h"
#include "engine.h"
#include "scene_terrain.h"
#include "scoped_timer.h"

namespace foldcar {

// Cause of an error: a line that breaks the rules, or a trial that could not be simulated.
enum class ErrorKind { kInput, kSimulation };

// A reply without its end of line; numbers read back to the same double.
std::string one_line(const nlohmann::ordered_json& value);
// The result as docs/carsim.md describes it, without the run's id and without a path.
nlohmann::ordered_json result_object(const TrialResult& result);
// {"error": …} as docs/carsim.md describes it; run_id may be empty.
std::string error_reply(std::size_t line_number, const std::string& run_id, ErrorKind kind,
                        const std::string& message);

// Remembers bodies and scenes by id and answers the other lines.
class BatchSession {
 public:
  // The engine must outlive the session.
  BatchSession(const Engine& engine, bool timed) : engine_(engine), timed_(timed) {}

  // The reply to a line, if it has one: a result or an error. Does not throw for bad input.
  std::optional<std::string> answer(std::size_t line_number, const std::string& line);

  const Stopwatch& stopwatch() const { return stopwatch_; }
  // Of all runs, their settling before the trial included.
  double simulated_s() const { return simulated_s_; }

 private:
  std::string run(const RunLine& run);
  std::string heights(const HeightsLine& heights);
  std::string mjcf(const MjcfLine& mjcf);
  const BodySpec& body(const char* line, const std::string& id) const;
  const SceneSpec& scene(const char* line, const std::string& id) const;
  // The real scene's terrain, made anew only for another scene or other heights or friction.
  const SceneTerrain& terrain(const SceneSpec& scene, const Reality& reality);

  const Engine& engine_;
  bool timed_;
  std::unordered_map<std::string, BodySpec> bodies_;
  std::unordered_map<std::string, SceneSpec> scenes_;
  std::string terrain_of_;  // the scene's id
  std::pair<double, double> terrain_factors_;
  std::optional<SceneTerrain> terrain_;
  Stopwatch stopwatch_;
  double simulated_s_ = 0;
};

}  // namespace foldcar
