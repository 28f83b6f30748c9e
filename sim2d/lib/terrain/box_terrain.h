// Terrain of upright boxes on flat ground: bumps, steps and step pyramids.
#pragma once

#include <vector>

#include "scene_spec.h"
#include "terrain.h"

namespace foldcar {

class BoxTerrain : public Terrain {
 public:
  explicit BoxTerrain(const std::vector<BoxSpec>& boxes);
  void slice(const SliceFrame& frame, const Span& span, const std::vector<Strip>& strips,
             std::vector<std::vector<Piece>>& pieces) const override;

 private:
  struct Box {
    double corner_x_m[4];
    double corner_y_m[4];
    double center_x_m, center_y_m, reach_m, height_m;
  };
  std::vector<Box> boxes_;
};

}  // namespace foldcar
