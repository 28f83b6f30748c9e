// The ground as the car meets it: height and friction over the plane, and cuts along strips of the car's frame.
//
// The side-view model needs the highest line of the surface within narrow strips along the car's heading. Blocks give
// it as straight pieces for each strip, the ground below them as fields to be sampled (ground_outline.h); profile.h
// combines them into one outline.
#pragma once

#include <cstddef>
#include <vector>

namespace foldcar {

class Ground;

// Pose of the car's frame in the world; s runs along the heading, y to its left.
struct SliceFrame {
  double x_m = 0;
  double y_m = 0;
  double heading_rad = 0;
};

// A strip of the car's frame between two values of y.
struct Strip {
  double y_min_m = 0;
  double y_max_m = 0;
};

// A range of s.
struct Span {
  double s_min_m = 0;
  double s_max_m = 0;
};

// A straight piece of surface over [s0, s1], from height z0 to z1; y tells which strip it comes from.
struct Piece {
  double s0_m = 0;
  double s1_m = 0;
  double z0_m = 0;
  double z1_m = 0;
  double y_m = 0;
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
  // Appends to pieces[k] the surfaces of all blocks in strips[k] within span, whether highest or not. Pieces that
  // continue each other (s1 of one is s0 of the next, the same y) are adjacent in the list.
  virtual void slice(const SliceFrame& frame, const Span& span, const std::vector<Strip>& strips,
                     std::vector<std::vector<Piece>>& pieces) const = 0;
};

}  // namespace foldcar
