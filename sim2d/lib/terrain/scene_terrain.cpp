#include "scene_terrain.h"

#include <algorithm>
#include <cmath>

#include "elementary_functions.h"

namespace foldcar {
namespace {

bool covers(const PatchSpec& patch, double x_m, double y_m) {
  const auto [s, c] = sine_and_cosine(patch.heading_rad);
  const double dx = x_m - patch.x_m, dy = y_m - patch.y_m;
  return std::abs(c * dx + s * dy) <= 0.5 * patch.length_m && std::abs(c * dy - s * dx) <= 0.5 * patch.width_m;
}

}  // namespace

SceneTerrain::SceneTerrain(const TerrainSpec& spec)
    : blocks_(spec.blocks.begin(), spec.blocks.end()), ground_(spec), patches_(spec.patches) {
  for (const BlockSpec& block : spec.blocks) solids_.push_back(make_solid(block));
}

double SceneTerrain::height_m(double x_m, double y_m) const {
  // The ground alone may be below z = 0; a block that stands there raises it to its own surface.
  double height_m = ground_.height_m(x_m, y_m);
  for (const Block& block : blocks_) {
    if (block.covers(x_m, y_m)) height_m = std::max(height_m, block.height_m(x_m, y_m));
  }
  return height_m;
}

double SceneTerrain::friction(double x_m, double y_m, double elsewhere) const {
  const auto last =
      std::find_if(patches_.rbegin(), patches_.rend(), [&](const PatchSpec& patch) { return covers(patch, x_m, y_m); });
  return last == patches_.rend() ? elsewhere : last->friction;
}

}  // namespace foldcar
