// `carsim step`: remembers bodies and scenes, and advances one trial at a time to the times that its caller asks for.
//
// Input: lines as docs/carsim.md describes them under "step". Output: one line for each that calls for one.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "body_spec.h"
#include "engine.h"
#include "json_reader.h"
#include "scene_spec.h"
#include "trial.h"

namespace foldcar {

// Remembers bodies and scenes by id and has at most one trial under way.
class StepSession {
 public:
  // The engine must outlive the session.
  explicit StepSession(const Engine& engine) : engine_(engine) {}
  // The reply to a line, if it has one. Does not throw for bad input or a trial that fails.
  std::optional<std::string> answer(std::size_t line_number, const std::string& line);

 private:
  nlohmann::ordered_json start(const nlohmann::json& line);
  nlohmann::ordered_json advance(const nlohmann::json& line);
  nlohmann::ordered_json rows(const nlohmann::json& line) const;
  nlohmann::ordered_json end(const nlohmann::json& line);
  nlohmann::ordered_json state_reply() const;
  Trial& trial(const char* line_kind) const;

  const Engine& engine_;
  // Shared with the trial under way, which goes on with its own when a later line has the same id.
  std::unordered_map<std::string, std::shared_ptr<const BodySpec>> bodies_;
  std::unordered_map<std::string, std::shared_ptr<const SceneSpec>> scenes_;
  std::shared_ptr<const BodySpec> body_;
  std::shared_ptr<const SceneSpec> scene_;
  std::unique_ptr<Trial> trial_;
  std::vector<Snapshot> advanced_;  // every step of the last advance, its end included
};

}  // namespace foldcar
