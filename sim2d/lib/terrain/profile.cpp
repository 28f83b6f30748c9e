#include "profile.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace foldcar {
namespace {

// Heights that differ by less than this share of the resolution count as equal.
constexpr double kSameHeight = 0.4;

// Height of the ground where an envelope has level pieces only.
constexpr double kNoGround_m = std::numeric_limits<double>::lowest();

bool level(const Piece& piece) { return piece.z0_m == piece.z1_m; }

bool continues(const Piece& before, const Piece& piece) {
  return before.s1_m == piece.s0_m && before.y_m == piece.y_m;
}

double height_at(const ProfileSegment& segment, double s_m) {
  if (segment.z0_m == segment.z1_m) return segment.z0_m;
  return segment.z0_m + (segment.z1_m - segment.z0_m) * (s_m - segment.s0_m) / (segment.s1_m - segment.s0_m);
}

// The highest of ground and level pieces between two breaks, and the strips of all that are as high within tolerance.
ProfileSegment highest_between(const std::vector<Piece>& pieces, const Piece& ground, double left, double right,
                               double tolerance_m) {
  const double middle = 0.5 * (left + right);
  double top_z = ground.z0_m, y_min_m = ground.y_m, y_max_m = ground.y_m;
  for (const Piece& piece : pieces) {
    if (middle < piece.s0_m || middle > piece.s1_m) continue;
    const double z_m = piece.z0_m;
    if (z_m < top_z - tolerance_m) continue;
    if (z_m > top_z + tolerance_m) y_min_m = y_max_m = piece.y_m;
    y_min_m = std::min(y_min_m, piece.y_m);
    y_max_m = std::max(y_max_m, piece.y_m);
    top_z = std::max(top_z, z_m);
  }
  return {left, right, top_z, top_z, y_min_m, y_max_m};
}

void level_envelope(const std::vector<Piece>& pieces, const Piece& ground, const Span& span, double resolution_m,
                    std::vector<double>& breaks, Profile& profile) {
  breaks.clear();
  for (const Piece& piece : pieces) {
    breaks.push_back(piece.s0_m);
    breaks.push_back(piece.s1_m);
  }
  std::sort(breaks.begin(), breaks.end());
  breaks.push_back(span.s_max_m);

  const double tolerance_m = kSameHeight * resolution_m;
  profile.clear();
  double left = span.s_min_m;
  for (const double right : breaks) {
    const bool last = right == span.s_max_m;
    if (right - left < resolution_m && !last) continue;
    if (right <= left) continue;
    const ProfileSegment segment = highest_between(pieces, ground, left, right, tolerance_m);
    if (!profile.empty()) {
      ProfileSegment& before = profile.back();
      const bool same_strips = before.y_min_m == segment.y_min_m && before.y_max_m == segment.y_max_m;
      if (same_strips && std::abs(before.z1_m - segment.z0_m) < tolerance_m) {
        before.s1_m = right;
        left = right;
        continue;
      }
    }
    profile.push_back(segment);
    left = right;
  }
}

// Appends the part of segment between left and right, or extends the outline's last segment if that is from the same
// one.
void append(Profile& profile, const ProfileSegment& segment, double left, double right, double y_min_m,
            double y_max_m, const ProfileSegment*& last) {
  const double end_m = height_at(segment, right);
  if (last == &segment && profile.back().y_min_m == y_min_m && profile.back().y_max_m == y_max_m) {
    profile.back().s1_m = right;
    profile.back().z1_m = end_m;
  } else {
    profile.push_back({left, right, height_at(segment, left), end_m, y_min_m, y_max_m});
  }
  last = &segment;
}

// Replaces the outline by its upper envelope with a curve of segments in ascending s, which may have gaps.
void raise(const Profile& curve, double tolerance_m, Profile& before, Profile& profile) {
  if (curve.empty()) return;
  before.swap(profile);
  profile.clear();
  const ProfileSegment* last = nullptr;
  auto over = curve.begin();
  for (const ProfileSegment& under : before) {
    double left = under.s0_m;
    while (left < under.s1_m) {
      while (over != curve.end() && over->s1_m <= left) ++over;
      const bool covered = over != curve.end() && over->s0_m <= left;
      double right = under.s1_m;
      if (over != curve.end()) right = std::min(right, covered ? over->s1_m : over->s0_m);
      if (!covered) {
        append(profile, under, left, right, under.y_min_m, under.y_max_m, last);
        left = right;
        continue;
      }
      const double at_left = height_at(*over, left) - height_at(under, left);
      const double at_right = height_at(*over, right) - height_at(under, right);
      if ((at_left > 0) != (at_right > 0)) {
        const double crossing = left + (right - left) * at_left / (at_left - at_right);
        if (crossing > left && crossing < right) right = crossing;
      }
      const double middle = 0.5 * (left + right);
      const double difference = height_at(*over, middle) - height_at(under, middle);
      const ProfileSegment& top = difference > 0 ? *over : under;
      const bool same = std::abs(difference) <= tolerance_m;
      append(profile, top, left, right, same ? std::min(over->y_min_m, under.y_min_m) : top.y_min_m,
             same ? std::max(over->y_max_m, under.y_max_m) : top.y_max_m, last);
      left = right;
    }
  }
}

// Raises the outline to every curve among the pieces: pieces that continue each other, at least one of them sloping.
void raise_to_curves(const std::vector<Piece>& pieces, double tolerance_m, EnvelopeScratch& scratch,
                     Profile& profile) {
  for (std::size_t first = 0; first < pieces.size();) {
    std::size_t end = first + 1;
    bool slopes = !level(pieces[first]);
    for (; end < pieces.size() && continues(pieces[end - 1], pieces[end]); ++end) slopes = slopes || !level(pieces[end]);
    if (slopes) {
      scratch.curve.clear();
      for (std::size_t i = first; i < end; ++i) {
        const Piece& piece = pieces[i];
        scratch.curve.push_back({piece.s0_m, piece.s1_m, piece.z0_m, piece.z1_m, piece.y_m, piece.y_m});
      }
      raise(scratch.curve, tolerance_m, scratch.before, profile);
    }
    first = end;
  }
}

void find_level(const std::vector<Piece>& pieces, std::vector<Piece>& found) {
  found.clear();
  for (std::size_t first = 0; first < pieces.size();) {
    std::size_t end = first + 1;
    bool slopes = !level(pieces[first]);
    for (; end < pieces.size() && continues(pieces[end - 1], pieces[end]); ++end) slopes = slopes || !level(pieces[end]);
    for (; first < end; ++first) {
      if (!slopes) found.push_back(pieces[first]);
    }
  }
}

}  // namespace

void upper_envelope(const std::vector<Piece>& pieces, const Piece& ground, const Span& span, double resolution_m,
                    EnvelopeScratch& scratch, Profile& profile) {
  if (std::all_of(pieces.begin(), pieces.end(), level)) {
    level_envelope(pieces, ground, span, resolution_m, scratch.breaks, profile);
    return;
  }
  find_level(pieces, scratch.level);
  level_envelope(scratch.level, ground, span, resolution_m, scratch.breaks, profile);
  raise_to_curves(pieces, kSameHeight * resolution_m, scratch, profile);
}

void raise_to_envelope(const std::vector<Piece>& pieces, double resolution_m, EnvelopeScratch& scratch,
                       Profile& profile) {
  const double tolerance_m = kSameHeight * resolution_m;
  find_level(pieces, scratch.level);
  if (!scratch.level.empty()) {
    const Span span{profile.front().s0_m, profile.back().s1_m};
    const Piece nothing{span.s_min_m, span.s_max_m, kNoGround_m, kNoGround_m, 0};
    level_envelope(scratch.level, nothing, span, resolution_m, scratch.breaks, scratch.curve);
    auto empty = [](const ProfileSegment& segment) { return segment.z0_m == kNoGround_m; };
    scratch.curve.erase(std::remove_if(scratch.curve.begin(), scratch.curve.end(), empty), scratch.curve.end());
    raise(scratch.curve, tolerance_m, scratch.before, profile);
  }
  raise_to_curves(pieces, tolerance_m, scratch, profile);
}

}  // namespace foldcar
