// A block on z = 0: an upright box, a ramp or a half-round, turned about the vertical.
#pragma once

#include "scene_spec.h"

namespace foldcar {

// One block.
class Block {
 public:
  explicit Block(const BlockSpec& spec);
  // Whether the block stands at a point of the world.
  bool covers(double x_m, double y_m) const;
  // Height of the surface at a point of the world that it covers.
  double height_m(double x_m, double y_m) const;

 private:
  // Coordinate along the block, from its middle, of a point of the world; height of the surface at that coordinate.
  double along_m(double x_m, double y_m) const;
  double surface_m(double u_m) const;

  BlockSpec spec_;
  double cosine_, sine_;
  double arc_radius_m_ = 0;
};

}  // namespace foldcar
