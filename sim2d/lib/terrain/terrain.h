// The ground as the car meets it: whatever can be cut along strips of the car's frame is a terrain.
//
// The side-view model never needs the surface itself, only its highest line within a narrow strip along
// the car's heading. A terrain returns that as straight pieces; profile.h makes one outline of them.
#pragma once

#include <cstddef>
#include <vector>

namespace foldcar {

// Where the car's frame stands in the world; s runs along the heading, y to its left.
struct SliceFrame {
  double x_m = 0;
  double y_m = 0;
  double heading_rad = 0;
};

// A strip of the car's frame between two values of y, and the span of s that is wanted.
struct Strip {
  double y_min_m = 0;
  double y_max_m = 0;
};

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

class Terrain {
 public:
  virtual ~Terrain() = default;
  // Appends to pieces[k] what stands above the flat ground in strips[k] within span, highest or not.
  virtual void slice(const SliceFrame& frame, const Span& span, const std::vector<Strip>& strips,
                     std::vector<std::vector<Piece>>& pieces) const = 0;
};

}  // namespace foldcar
