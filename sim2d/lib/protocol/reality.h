// How a real car and its ground differ from design and scene: a flat object of numbers, which carsim applies before a run.
//
// Names and limits stand in one table (docs/carsim.md). A difference is relative: the number becomes value * (1 + difference).
// A shift is added. Numbers of the changed car or scene outside the limits of the input become these limits.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "body_spec.h"
#include "json_reader.h"
#include "scene_spec.h"

namespace foldcar {

struct Reality {
  std::map<std::string, double> numbers;               // of the car as a whole and of the ground
  std::map<std::string, std::vector<double>> wheels;  // by servo channel

  bool empty() const { return numbers.empty() && wheels.empty(); }
};

// The limits of its numbers, by name.
std::map<std::string, Limits> reality_limits();

// InputError names key, value and limit.
Reality read_reality(JsonReader reader);

// By what the ground's friction and heights are multiplied.
std::pair<double, double> ground_factors(const Reality& reality);

// The body of the real car, and the real scene. InputError if a supply's resistance leaves no current for its servos.
BodySpec real_body(BodySpec body, const Reality& reality);
SceneSpec real_scene(SceneSpec scene, const Reality& reality);

}  // namespace foldcar
