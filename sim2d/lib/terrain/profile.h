// The outline that a wheel or the belly meets: the upper envelope of a terrain's pieces over the ground.
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

// What an envelope is made with; kept by the caller, since the hot loop does not allocate.
struct EnvelopeScratch {
  std::vector<Piece> level;
  std::vector<double> breaks;
  Profile curve;
  Profile before;
};

// Highest outline of a level ground and pieces over span, left to right without gaps. Level details shorter than
// resolution_m along s are merged into their neighbours.
void upper_envelope(const std::vector<Piece>& pieces, const Piece& ground, const Span& span, double resolution_m,
                    EnvelopeScratch& scratch, Profile& profile);

// The same over the outline of the ground that profile holds.
void raise_to_envelope(const std::vector<Piece>& pieces, double resolution_m, EnvelopeScratch& scratch,
                       Profile& profile);

}  // namespace foldcar
