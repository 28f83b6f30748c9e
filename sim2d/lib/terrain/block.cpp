#include "block.h"

#include <algorithm>
#include <cmath>

#include "elementary_functions.h"

namespace foldcar {
namespace {

// Blocks that adjoin, as the slopes and the plateau of a ramp, have no slit between them: places and headings are rounded
// to 1e-9 m and rad, which moves the end of a block by up to 5e-8 m.
constexpr double kRounding_m = 1e-7;

}  // namespace

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
  return std::abs(along_m(x_m, y_m)) <= 0.5 * spec_.length_m + kRounding_m &&
         std::abs(cosine_ * dy - sine_ * dx) <= 0.5 * spec_.width_m + kRounding_m;
}

double Block::height_m(double x_m, double y_m) const { return surface_m(along_m(x_m, y_m)); }

double Block::along_m(double x_m, double y_m) const {
  return cosine_ * (x_m - spec_.x_m) + sine_ * (y_m - spec_.y_m);
}

}  // namespace foldcar
