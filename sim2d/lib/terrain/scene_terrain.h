// A scene's terrain: blocks on the ground, and patches with a friction of their own.
#pragma once

#include <vector>

#include "block.h"
#include "ground.h"
#include "scene_spec.h"
#include "terrain.h"

namespace foldcar {

// Largest number of faces of blocks that a step looks at, over all wheels and bellies: it bounds its computing time.
constexpr double kMostFaces = 60000;

// The terrain of one scene specification.
class SceneTerrain : public Terrain {
 public:
  explicit SceneTerrain(const TerrainSpec& spec);
  double height_m(double x_m, double y_m) const override;
  double friction(double x_m, double y_m, double elsewhere) const override;
  bool has_patches() const override { return !patches_.empty(); }
  const Ground* ground() const override { return ground_.flat() ? nullptr : &ground_; }
  const std::vector<Solid>& solids() const override { return solids_; }

 private:
  std::vector<Block> blocks_;
  std::vector<Solid> solids_;
  Ground ground_;
  std::vector<PatchSpec> patches_;
};

}  // namespace foldcar
