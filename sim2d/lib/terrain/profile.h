// The outline that a wheel or the belly meets: the upper envelope of a terrain's pieces over flat ground.
#pragma once

#include <vector>

#include "terrain.h"

namespace foldcar {

// One straight run of the outline. y_min..y_max are the strips whose surface is (within resolution) the
// highest there, so that a contact can be placed across the car.
struct ProfileSegment {
  double s0_m = 0;
  double s1_m = 0;
  double z0_m = 0;
  double z1_m = 0;
  double y_min_m = 0;
  double y_max_m = 0;
};

using Profile = std::vector<ProfileSegment>;

// Highest outline of ground and pieces over span, left to right without gaps. Details shorter than
// resolution_m along s are merged into their neighbours. scratch avoids allocation in the hot loop.
void upper_envelope(const std::vector<Piece>& pieces, const Piece& ground, const Span& span,
                    double resolution_m, std::vector<double>& scratch, Profile& profile);

}  // namespace foldcar
