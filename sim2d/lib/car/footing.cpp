#include "footing.h"

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

// The ground is looked for this far below the surface: more than the outline's own errors, less than a step worth the
// name.
constexpr double kDepth_m = 0.001;
// An edge is looked for this far to either side: the car has moved on since its terrain was cut.
constexpr double kReach_m = 0.002;
// Lines across a strip on which it is looked for; they stay within this share of its width.
constexpr int kLines = 7;
constexpr double kWithin = 0.98;

}  // namespace

std::optional<Footing> footing(const Terrain& terrain, const SliceFrame& frame, const StripContact& contact) {
  const Footing whole{0, contact.width_m};
  const double z_m = contact.z_m - kDepth_m * contact.normal_z;
  // Nothing is lower than level ground; smooth ground alone has no edges.
  if (terrain.ground() == nullptr ? z_m <= 0 : !terrain.has_blocks()) return whole;
  const double ahead_m = contact.ahead_m - kDepth_m * contact.normal_x;
  const double c = std::cos(frame.heading_rad), s = std::sin(frame.heading_rad);
  const auto stands = [&](double across_m) {
    const double y_m = contact.middle_y_m + across_m;
    for (const double x_m : {ahead_m, ahead_m - kReach_m, ahead_m + kReach_m}) {
      if (terrain.height_m(frame.x_m + c * x_m - s * y_m, frame.y_m + s * x_m + c * y_m) >= z_m) return true;
    }
    return false;
  };
  const double half_m = 0.5 * kWithin * contact.width_m;
  if (stands(-half_m) && stands(half_m)) return whole;
  double from_m = half_m, to_m = -half_m;
  for (int line = 0; line < kLines; ++line) {
    const double across_m = half_m * (2.0 * line / (kLines - 1) - 1);
    if (!stands(across_m)) continue;
    from_m = std::min(from_m, across_m);
    to_m = std::max(to_m, across_m);
  }
  if (from_m > to_m) return std::nullopt;
  return Footing{0.5 * (from_m + to_m), to_m - from_m};
}

}  // namespace foldcar
