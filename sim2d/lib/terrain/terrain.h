// The ground as the car meets it: height and friction over the plane, the blocks and the smooth ground on which they stand.
#pragma once

#include <vector>

#include "solid.h"

namespace foldcar {

class Ground;

// Pose of the car's frame in the world; s runs along the heading, y to its left.
struct SliceFrame {
  double x_m = 0;
  double y_m = 0;
  double heading_rad = 0;
};

// A range of s.
struct Span {
  double s_min_m = 0;
  double s_max_m = 0;
};

// A surface over the plane; what it returns depends on its arguments alone.
class Terrain {
 public:
  virtual ~Terrain() = default;
  // The highest surface at a point of the world.
  virtual double height_m(double x_m, double y_m) const = 0;
  // Friction coefficient of the surface at a point of the world; elsewhere if nothing there sets one.
  virtual double friction(double x_m, double y_m, double elsewhere) const = 0;
  // Whether anything sets a friction coefficient.
  virtual bool has_patches() const = 0;
  // The smooth ground on which everything stands; null if it is z = 0 throughout.
  virtual const Ground* ground() const = 0;
  // The blocks, each of which rises above everything under it.
  virtual const std::vector<Solid>& solids() const = 0;
};

}  // namespace foldcar
