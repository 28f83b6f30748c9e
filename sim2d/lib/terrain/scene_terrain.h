// A scene's terrain: blocks on the ground, and patches with a friction of their own.
#pragma once

#include <vector>

#include "block.h"
#include "ground.h"
#include "scene_spec.h"
#include "terrain.h"

namespace foldcar {

// Largest number of pieces of blocks' outlines within reach of a car, over all lines of its wheels and belly: it bounds
// the computing time of a step.
constexpr double kMostPieces = 30000;

// The terrain of one scene specification.
class SceneTerrain : public Terrain {
 public:
  explicit SceneTerrain(const TerrainSpec& spec);
  double height_m(double x_m, double y_m) const override;
  double friction(double x_m, double y_m, double elsewhere) const override;
  bool has_patches() const override { return !patches_.empty(); }
  const Ground* ground() const override { return ground_.flat() ? nullptr : &ground_; }
  void slice(const SliceFrame& frame, const Span& span, const std::vector<Strip>& strips,
             std::vector<std::vector<Piece>>& pieces) const override;

 private:
  std::vector<Block> blocks_;
  Ground ground_;
  std::vector<PatchSpec> patches_;
};

}  // namespace foldcar
