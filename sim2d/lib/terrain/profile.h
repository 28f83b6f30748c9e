// The outline of the smooth ground that a wheel or the belly meets.
#pragma once

#include <vector>

namespace foldcar {

// A straight segment of the outline. y_min_m to y_max_m are the lines across that are the highest
// there, from which the lateral position of a contact follows.
struct ProfileSegment {
  double s0_m = 0;
  double s1_m = 0;
  double z0_m = 0;
  double z1_m = 0;
  double y_min_m = 0;
  double y_max_m = 0;
};

// An outline: segments in ascending s.
using Profile = std::vector<ProfileSegment>;

}  // namespace foldcar
