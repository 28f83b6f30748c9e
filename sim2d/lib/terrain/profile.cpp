#include "profile.h"

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

bool flat(const Piece& piece) { return piece.z0_m == piece.z1_m; }

double height_at(const Piece& piece, double s_m) {
  if (flat(piece)) return piece.z0_m;
  return piece.z0_m + (piece.z1_m - piece.z0_m) * (s_m - piece.s0_m) / (piece.s1_m - piece.s0_m);
}

bool covers(const Piece& piece, double s_m) { return piece.s0_m <= s_m && s_m <= piece.s1_m; }

// The highest of ground and pieces between two breaks, and the strips of all that are as high within tolerance.
ProfileSegment highest_between(const std::vector<Piece>& pieces, const Piece& ground, double left, double right,
                               double tolerance_m) {
  const double middle = 0.5 * (left + right);
  const Piece* top = &ground;
  double top_z = height_at(ground, middle), y_min_m = ground.y_m, y_max_m = ground.y_m;
  for (const Piece& piece : pieces) {
    if (!covers(piece, middle)) continue;
    const double z_m = height_at(piece, middle);
    if (z_m < top_z - tolerance_m) continue;
    if (z_m > top_z + tolerance_m) y_min_m = y_max_m = piece.y_m;
    y_min_m = std::min(y_min_m, piece.y_m);
    y_max_m = std::max(y_max_m, piece.y_m);
    if (z_m > top_z) {
      top = &piece;
      top_z = z_m;
    }
  }
  return {left, right, height_at(*top, left), height_at(*top, right), y_min_m, y_max_m};
}

// Crossings of two pieces within a stretch are breakpoints too; flat pieces never cross.
void add_crossings(const std::vector<Piece>& pieces, std::vector<double>& breaks) {
  if (std::all_of(pieces.begin(), pieces.end(), flat)) return;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    for (std::size_t j = i + 1; j < pieces.size(); ++j) {
      const Piece &a = pieces[i], &b = pieces[j];
      if (flat(a) && flat(b)) continue;
      const double lo = std::max(a.s0_m, b.s0_m), hi = std::min(a.s1_m, b.s1_m);
      if (hi <= lo) continue;
      const double at_lo = height_at(a, lo) - height_at(b, lo), at_hi = height_at(a, hi) - height_at(b, hi);
      if ((at_lo > 0) != (at_hi > 0)) breaks.push_back(lo + (hi - lo) * at_lo / (at_lo - at_hi));
    }
  }
}

}  // namespace

void upper_envelope(const std::vector<Piece>& pieces, const Piece& ground, const Span& span,
                    double resolution_m, std::vector<double>& scratch, Profile& profile) {
  std::vector<double>& breaks = scratch;
  breaks.clear();
  for (const Piece& piece : pieces) {
    breaks.push_back(piece.s0_m);
    breaks.push_back(piece.s1_m);
  }
  add_crossings(pieces, breaks);
  std::sort(breaks.begin(), breaks.end());
  breaks.push_back(span.s_max_m);

  profile.clear();
  double left = span.s_min_m;
  for (const double right : breaks) {
    const bool last = right == span.s_max_m;
    if (right - left < resolution_m && !last) continue;
    if (right <= left) continue;
    const ProfileSegment segment = highest_between(pieces, ground, left, right, 0.4 * resolution_m);
    if (!profile.empty()) {
      ProfileSegment& before = profile.back();
      const bool same_strips = before.y_min_m == segment.y_min_m && before.y_max_m == segment.y_max_m;
      const bool both_flat = before.z0_m == before.z1_m && segment.z0_m == segment.z1_m;
      if (same_strips && both_flat && std::abs(before.z1_m - segment.z0_m) < 0.4 * resolution_m) {
        before.s1_m = right;
        left = right;
        continue;
      }
    }
    profile.push_back(segment);
    left = right;
  }
}

}  // namespace foldcar
