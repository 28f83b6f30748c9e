// `carsim step`: remembers bodies and scenes, and advances one trial at a time as its caller says.
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
#include "json_reader.h"
#include "scene_spec.h"
#include "trial.h"

namespace foldcar {

// Remembers bodies and scenes by id and has at most one trial under way.
class StepSession {
 public:
  // The reply to a line, if it calls for one. Never throws for bad input or a trial that breaks down.
  std::optional<std::string> answer(std::size_t line_number, const std::string& line);

 private:
  nlohmann::ordered_json start(const nlohmann::json& line);
  nlohmann::ordered_json advance(const nlohmann::json& line);
  nlohmann::ordered_json rows(const nlohmann::json& line) const;
  nlohmann::ordered_json end(const nlohmann::json& line);
  nlohmann::ordered_json state_reply() const;
  Trial& trial(const char* line_kind) const;

  // Shared with the trial under way, which a later line of the same id must not pull the ground from under.
  std::unordered_map<std::string, std::shared_ptr<const BodySpec>> bodies_;
  std::unordered_map<std::string, std::shared_ptr<const SceneSpec>> scenes_;
  std::shared_ptr<const BodySpec> body_;
  std::shared_ptr<const SceneSpec> scene_;
  std::unique_ptr<Trial> trial_;
  std::vector<Snapshot> advanced_;  // every step of the last advance, its end included
};

}  // namespace foldcar
