#include "box_terrain.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace foldcar {
namespace {

// Range of s that the convex quadrilateral (s, y) covers within the strip; false if they do not meet.
bool clip(const double* s, const double* y, const Strip& strip, double& s_min, double& s_max) {
  s_min = std::numeric_limits<double>::max();
  s_max = std::numeric_limits<double>::lowest();
  auto take = [&](double value) {
    s_min = std::min(s_min, value);
    s_max = std::max(s_max, value);
  };
  for (int i = 0; i < 4; ++i) {
    const int j = (i + 1) & 3;
    if (y[i] >= strip.y_min_m && y[i] <= strip.y_max_m) take(s[i]);
    for (const double limit : {strip.y_min_m, strip.y_max_m}) {
      if ((y[i] < limit) != (y[j] < limit)) take(s[i] + (s[j] - s[i]) * (limit - y[i]) / (y[j] - y[i]));
    }
  }
  return s_max > s_min;
}

}  // namespace

BoxTerrain::BoxTerrain(const std::vector<BoxSpec>& boxes) {
  constexpr double kAlong[4] = {0.5, -0.5, -0.5, 0.5};
  constexpr double kAcross[4] = {0.5, 0.5, -0.5, -0.5};
  for (const BoxSpec& spec : boxes) {
    Box box;
    const double c = std::cos(spec.heading_rad), s = std::sin(spec.heading_rad);
    for (int i = 0; i < 4; ++i) {
      const double along = kAlong[i] * spec.length_m, across = kAcross[i] * spec.width_m;
      box.corner_x_m[i] = spec.x_m + c * along - s * across;
      box.corner_y_m[i] = spec.y_m + s * along + c * across;
    }
    box.center_x_m = spec.x_m;
    box.center_y_m = spec.y_m;
    box.reach_m = 0.5 * std::hypot(spec.length_m, spec.width_m);
    box.height_m = spec.height_m;
    boxes_.push_back(box);
  }
}

void BoxTerrain::slice(const SliceFrame& frame, const Span& span, const std::vector<Strip>& strips,
                       std::vector<std::vector<Piece>>& pieces) const {
  const double c = std::cos(frame.heading_rad), s = std::sin(frame.heading_rad);
  for (const Box& box : boxes_) {
    const double center_s = c * (box.center_x_m - frame.x_m) + s * (box.center_y_m - frame.y_m);
    if (center_s + box.reach_m < span.s_min_m || center_s - box.reach_m > span.s_max_m) continue;
    double corner_s[4], corner_y[4];
    for (int i = 0; i < 4; ++i) {
      const double dx = box.corner_x_m[i] - frame.x_m, dy = box.corner_y_m[i] - frame.y_m;
      corner_s[i] = c * dx + s * dy;
      corner_y[i] = c * dy - s * dx;
    }
    for (std::size_t k = 0; k < strips.size(); ++k) {
      double s_min, s_max;
      if (!clip(corner_s, corner_y, strips[k], s_min, s_max)) continue;
      s_min = std::max(s_min, span.s_min_m);
      s_max = std::min(s_max, span.s_max_m);
      if (s_max <= s_min) continue;
      const double y_m = 0.5 * (strips[k].y_min_m + strips[k].y_max_m);
      pieces[k].push_back({s_min, s_max, box.height_m, box.height_m, y_m});
    }
  }
}

}  // namespace foldcar
