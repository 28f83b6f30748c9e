#include "block.h"

#include <algorithm>
#include <cmath>

#include "elementary_functions.h"

namespace foldcar {

Block::Block(const BlockSpec& spec)
    : spec_(spec), cosine_(cosine(spec.heading_rad)), sine_(sine(spec.heading_rad)) {
  if (spec.kind == BlockSpec::Kind::kHalfRound) {
    arc_radius_m_ = arc_radius_m(spec);
  }
}

double Block::surface_m(double u_m) const {
  switch (spec_.kind) {
    case BlockSpec::Kind::kBox: break;
    case BlockSpec::Kind::kRamp: return spec_.height_m * (u_m / spec_.length_m + 0.5);
    case BlockSpec::Kind::kHalfRound:
      return std::sqrt(std::max(0.0, arc_radius_m_ * arc_radius_m_ - u_m * u_m)) - arc_radius_m_ +
             spec_.height_m;
  }
  return spec_.height_m;
}

bool Block::covers(double x_m, double y_m) const {
  const double dx = x_m - spec_.x_m, dy = y_m - spec_.y_m;
  return std::abs(along_m(x_m, y_m)) <= 0.5 * spec_.length_m &&
         std::abs(cosine_ * dy - sine_ * dx) <= 0.5 * spec_.width_m;
}

double Block::height_m(double x_m, double y_m) const { return surface_m(along_m(x_m, y_m)); }

double Block::along_m(double x_m, double y_m) const {
  return cosine_ * (x_m - spec_.x_m) + sine_ * (y_m - spec_.y_m);
}

}  // namespace foldcar
