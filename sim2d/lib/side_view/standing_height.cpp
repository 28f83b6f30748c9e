#include "standing_height.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace foldcar {

double axle_height_m(const Profile& profile, double axle_s_m, const WheelSpec& wheel) {
  const double radius_m = wheel.radius_m;
  const double x_m = axle_s_m + wheel.eccentricity_m * std::cos(wheel.eccentricity_phase_rad);
  double height_m = std::numeric_limits<double>::lowest();
  for (const ProfileSegment& segment : profile) {
    const double lo = std::max(segment.s0_m, x_m - radius_m), hi = std::min(segment.s1_m, x_m + radius_m);
    if (hi < lo) continue;
    const double nearest = std::clamp(x_m, lo, hi);
    for (const double s_m : {lo, nearest, hi}) {
      const double run = segment.s1_m - segment.s0_m;
      const double z_m =
          run > 0 ? segment.z0_m + (segment.z1_m - segment.z0_m) * (s_m - segment.s0_m) / run : segment.z0_m;
      const double dx = s_m - x_m;
      height_m = std::max(height_m, z_m + std::sqrt(std::max(0.0, radius_m * radius_m - dx * dx)));
    }
  }
  return height_m - wheel.eccentricity_m * std::sin(wheel.eccentricity_phase_rad);
}

double resting_axle_height_m(const Profile& ground, const SegmentSpec& segment, double reference_m) {
  const double middle_m = segment.x_m - reference_m;
  const double bottom_m = segment.center_z_m - 0.5 * segment.height_m;
  double height_m = std::numeric_limits<double>::lowest();
  for (const ProfileSegment& piece : ground) {
    if (piece.s1_m < middle_m - 0.5 * segment.length_m || piece.s0_m > middle_m + 0.5 * segment.length_m) continue;
    height_m = std::max(height_m, std::max(piece.z0_m, piece.z1_m) - bottom_m);
  }
  return height_m;
}

}  // namespace foldcar
