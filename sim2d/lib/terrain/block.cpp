#include "block.h"

#include <limits>
#include <utility>

namespace foldcar {

// The block seen from the frame: its corners in order.
struct BlockCorners {
  double s[4];
  double y[4];
};

struct Interval {
  double min_m = std::numeric_limits<double>::max();
  double max_m = std::numeric_limits<double>::lowest();
  void include(double value_m) {
    min_m = std::min(min_m, value_m);
    max_m = std::max(max_m, value_m);
  }
};

// Coordinates along the block, from its middle, of points of the frame.
struct AlongBlock {
  double middle_s_m, middle_y_m, per_s, per_y;
  Interval of(double s_m, const Interval& y_m) const {
    Interval along;
    for (const double y : {y_m.min_m, y_m.max_m}) along.include((s_m - middle_s_m) * per_s + (y - middle_y_m) * per_y);
    return along;
  }
};

namespace {

constexpr double kArcError_m = 0.00008;

// Calls visit with every s at which the convex quadrilateral has a corner within the strip or a side crosses a limit of
// the strip.
template <typename Visit>
void for_each_corner(const BlockCorners& corners, const Strip& strip, const Visit& visit) {
  const double *s = corners.s, *y = corners.y;
  for (int i = 0; i < 4; ++i) {
    const int j = (i + 1) & 3;
    if (y[i] >= strip.y_min_m && y[i] <= strip.y_max_m) visit(s[i]);
    for (const double limit : {strip.y_min_m, strip.y_max_m}) {
      if ((y[i] < limit) != (y[j] < limit)) visit(s[i] + (s[j] - s[i]) * (limit - y[i]) / (y[j] - y[i]));
    }
  }
}

// The interval of y within the strip that the quadrilateral covers at s = at.
Interval covered_at(double at, const BlockCorners& corners, const Strip& strip) {
  const double *s = corners.s, *y = corners.y;
  Interval covered;
  for (int i = 0; i < 4; ++i) {
    const int j = (i + 1) & 3;
    if ((at < s[i]) == (at < s[j]) && at != s[i] && at != s[j]) continue;
    if (s[i] == s[j]) {
      covered.include(y[i]);
      covered.include(y[j]);
    } else {
      covered.include(y[i] + (y[j] - y[i]) * (at - s[i]) / (s[j] - s[i]));
    }
  }
  if (covered.max_m < covered.min_m) covered.min_m = covered.max_m = 0.5 * (strip.y_min_m + strip.y_max_m);
  return {std::clamp(covered.min_m, strip.y_min_m, strip.y_max_m),
          std::clamp(covered.max_m, strip.y_min_m, strip.y_max_m)};
}

}  // namespace

Block::Block(const BlockSpec& spec)
    : spec_(spec),
      cosine_(std::cos(spec.heading_rad)),
      sine_(std::sin(spec.heading_rad)),
      reach_{spec.x_m, spec.y_m, 0.5 * std::hypot(spec.length_m, spec.width_m)} {
  constexpr double kAlong[4] = {0.5, -0.5, -0.5, 0.5};
  constexpr double kAcross[4] = {0.5, 0.5, -0.5, -0.5};
  for (int i = 0; i < 4; ++i) {
    const double along = kAlong[i] * spec.length_m, across = kAcross[i] * spec.width_m;
    corner_x_m_[i] = spec.x_m + cosine_ * along - sine_ * across;
    corner_y_m_[i] = spec.y_m + sine_ * along + cosine_ * across;
  }
  if (spec.kind == BlockSpec::Kind::kHalfRound) {
    arc_radius_m_ = (0.25 * spec.length_m * spec.length_m + spec.height_m * spec.height_m) / (2 * spec.height_m);
    const double half_rad = std::asin(std::min(1.0, 0.5 * spec.length_m / arc_radius_m_));
    const int chords = static_cast<int>(std::ceil(2 * half_rad / std::sqrt(8 * kArcError_m / arc_radius_m_)));
    for (int i = 1; i < chords; ++i) {
      arc_node_m_.push_back(arc_radius_m_ * std::sin(half_rad * (2.0 * i / chords - 1)));
    }
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

void Block::slice(const SliceFrame& frame, double cosine, double sine, const Span& span,
                  const std::vector<Strip>& strips, std::vector<std::vector<Piece>>& pieces) const {
  const double dx = reach_.x_m - frame.x_m, dy = reach_.y_m - frame.y_m;
  const double middle_s = cosine * dx + sine * dy;
  if (middle_s + reach_.radius_m < span.s_min_m || middle_s - reach_.radius_m > span.s_max_m) return;
  BlockCorners corners;
  for (int i = 0; i < 4; ++i) {
    const double corner_dx = corner_x_m_[i] - frame.x_m, corner_dy = corner_y_m_[i] - frame.y_m;
    corners.s[i] = cosine * corner_dx + sine * corner_dy;
    corners.y[i] = cosine * corner_dy - sine * corner_dx;
  }
  const AlongBlock along{middle_s, cosine * dy - sine * dx, cosine * cosine_ + sine * sine_,
                         cosine * sine_ - sine * cosine_};
  for (std::size_t k = 0; k < strips.size(); ++k) {
    Interval within;
    for_each_corner(corners, strips[k], [&](double at) { within.include(at); });
    within.min_m = std::max(within.min_m, span.s_min_m);
    within.max_m = std::min(within.max_m, span.s_max_m);
    if (within.max_m <= within.min_m) continue;
    const double y_m = 0.5 * (strips[k].y_min_m + strips[k].y_max_m);
    if (spec_.kind == BlockSpec::Kind::kBox) {
      pieces[k].push_back({within.min_m, within.max_m, spec_.height_m, spec_.height_m, y_m});
    } else {
      add_curve(corners, along, within, strips[k], pieces[k]);
    }
  }
}

// The highest point across the strip is on a ramp the farthest along it, on an arc the one nearest to its middle. Its
// coordinate along the block is a linear function of s between the breaks.
void Block::add_curve(const BlockCorners& corners, const AlongBlock& along, const Interval& within, const Strip& strip,
                      std::vector<Piece>& pieces) const {
  const bool ramp = spec_.kind == BlockSpec::Kind::kRamp;
  constexpr int kMaxBreaks = 24;
  double breaks[kMaxBreaks] = {within.min_m, within.max_m};
  int count = 2;
  for_each_corner(corners, strip, [&](double at) {
    if (at > within.min_m && at < within.max_m && count < kMaxBreaks) breaks[count++] = at;
  });
  std::sort(breaks, breaks + count);
  auto crest_m = [&](const Interval& covered_along) {
    return ramp ? covered_along.max_m : std::clamp(0.0, covered_along.min_m, covered_along.max_m);
  };
  for (int i = 0; i + 1 < count; ++i) {
    if (breaks[i + 1] <= breaks[i]) continue;
    const Interval from = along.of(breaks[i], covered_at(breaks[i], corners, strip));
    const Interval to = along.of(breaks[i + 1], covered_at(breaks[i + 1], corners, strip));
    // On an arc that function has a kink where an end of the covered interval passes the middle.
    double bends[4] = {0, 1, 1, 1};
    int parts = 1;
    for (const auto& [a, b] : {std::pair{from.min_m, to.min_m}, std::pair{from.max_m, to.max_m}}) {
      if (!ramp && (a < 0) != (b < 0)) bends[parts++] = a / (a - b);
    }
    if (parts == 3 && bends[1] > bends[2]) std::swap(bends[1], bends[2]);
    bends[parts] = 1;
    auto at = [](double a, double b, double share) { return share < 1 ? a + (b - a) * share : b; };
    for (int part = 0; part < parts; ++part) {
      const double share[2] = {bends[part], bends[part + 1]};
      double s_m[2], crest[2];
      for (int end = 0; end < 2; ++end) {
        s_m[end] = at(breaks[i], breaks[i + 1], share[end]);
        crest[end] =
            crest_m({at(from.min_m, to.min_m, share[end]), at(from.max_m, to.max_m, share[end])});
      }
      add_run(s_m, crest, 0.5 * (strip.y_min_m + strip.y_max_m), pieces);
    }
  }
}

void Block::add_run(const double* s_m, const double* crest_m, double y_m, std::vector<Piece>& pieces) const {
  double s0_m = s_m[0], z0_m = surface_m(crest_m[0]);
  auto add = [&](double s1_m, double z1_m) {
    if (s1_m <= s0_m) return;
    pieces.push_back({s0_m, s1_m, z0_m, z1_m, y_m});
    s0_m = s1_m;
    z0_m = z1_m;
  };
  const double per_m = (s_m[1] - s_m[0]) / (crest_m[1] - crest_m[0]);
  auto add_node = [&](double u_m) { add(s_m[0] + (u_m - crest_m[0]) * per_m, surface_m(u_m)); };
  if (crest_m[0] < crest_m[1]) {
    auto node = std::upper_bound(arc_node_m_.begin(), arc_node_m_.end(), crest_m[0]);
    for (; node != arc_node_m_.end() && *node < crest_m[1]; ++node) add_node(*node);
  } else if (crest_m[0] > crest_m[1]) {
    auto node = std::lower_bound(arc_node_m_.begin(), arc_node_m_.end(), crest_m[0]);
    while (node != arc_node_m_.begin() && *--node > crest_m[1]) add_node(*node);
  }
  add(s_m[1], surface_m(crest_m[1]));
}

}  // namespace foldcar
