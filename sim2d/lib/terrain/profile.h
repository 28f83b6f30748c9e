// The outline that a wheel or the belly meets: the upper envelope of a terrain's pieces and the ground.
#pragma once

#include <vector>

#include "terrain.h"

namespace foldcar {

// A straight segment of the outline. y_min_m to y_max_m are the strips whose surface is the highest there (within the
// resolution), from which the lateral position of a contact follows.
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

// Working memory of the functions below, kept by the caller so that they do not allocate.
struct EnvelopeScratch {
  std::vector<Piece> level;
  std::vector<double> breaks;
  Profile curve;
  Profile before;
};

// Fills profile with the upper envelope of pieces and a level ground over span, in ascending s without gaps. Level
// details shorter than resolution_m along s are merged into their neighbours.
void upper_envelope(const std::vector<Piece>& pieces, const Piece& ground, const Span& span, double resolution_m,
                    EnvelopeScratch& scratch, Profile& profile);

// Replaces the outline of the ground in profile by its upper envelope with pieces.
void raise_to_envelope(const std::vector<Piece>& pieces, double resolution_m, EnvelopeScratch& scratch,
                       Profile& profile);

}  // namespace foldcar
