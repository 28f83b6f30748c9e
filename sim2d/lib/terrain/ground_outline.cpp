#include "ground_outline.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>

#include "elementary_functions.h"

namespace foldcar {
namespace {

// Largest height error of a chord between two stations, and of the ground between two lines.
constexpr double kChordError_m = 0.0001;
constexpr double kLineError_m = 0.00009;
// Limit for the belly, which is wide and seldom touches the ground: enough lines for hills, too few for the roughest
// ground.
constexpr std::size_t kMaxLines = 33;
// Stations lie on multiples of this, or evenly between them.
constexpr double kCell_m = 0.02;
// Box2D's chain would merge stations that are closer.
constexpr double kMinSpacing_m = 0.0008;

void check_heights(double heights) {
  if (heights <= kMostHeights) return;
  throw std::runtime_error("scene.terrain.heights: the ground under the car takes " +
                           std::to_string(static_cast<std::int64_t>(heights)) + " heights at a time, the limit is " +
                           std::to_string(static_cast<std::int64_t>(kMostHeights)) +
                           ": let fewer pieces overlap, or make them smoother");
}

// Length of a chord that is error_m off an arc of this curvature in its middle: error = curvature · length² / 8.
double chord_m(double curvature_1_m, double error_m) { return std::sqrt(8 * error_m / curvature_1_m); }

// Upper bound of the ground's curvature (1/m) within the disc: the sum of the fields' bounds.
double curvature_1_m(const std::vector<const GroundField*>& fields, const Disc& disc) {
  double sum = 0;
  for (const GroundField* field : fields) sum += field->curvature_1_m(disc);
  return sum;
}

}  // namespace

// Chooses at which stations along the car and on how many lines across it heights are sampled: so close that chords
// between them are off by at most kChordError_m and kLineError_m, by a bound of the ground's curvature in cells of
// kCell_m. The plan holds while the car stays within kPlanSideways_m and kPlanTurn_rad.
void GroundOutline::plan(const Ground& ground, const SliceFrame& frame, double s_m, const Span& span,
                         const LateralSpan& across) {
  // No structured binding: a lambda may capture one only from C++20 on.
  const SineCosine turn = sine_and_cosine(frame.heading_rad);
  const double s = turn.sine, c = turn.cosine;
  const double reach_m = std::max(-span.s_min_m, span.s_max_m);
  const double pad_m = kPlanSideways_m + kPlanTurn_rad * reach_m;
  const double y_min_m = across.middle_m + across.scale * across.from_m - pad_m;
  const double y_max_m = across.middle_m + across.scale * across.to_m + pad_m;
  auto disc = [&](double at_s_m, double at_y_m, double radius_m) {
    return Disc{frame.x_m + c * at_s_m - s * at_y_m, frame.y_m + s * at_s_m + c * at_y_m, radius_m};
  };
  const double middle_y_m = 0.5 * (y_min_m + y_max_m);
  ground.find(disc(0.5 * (span.s_min_m + span.s_max_m), middle_y_m,
                   0.5 * hypotenuse(span.s_max_m - span.s_min_m, y_max_m - y_min_m)),
              fields_);
  // A row of squares across covers all ground that a cell of s can lie on while the plan holds.
  const auto columns = static_cast<int>(std::ceil((y_max_m - y_min_m) / (2 * kCell_m)));
  check_heights((span.s_max_m - span.s_min_m) / kCell_m * columns * static_cast<double>(fields_.size()));
  const double column_m = (y_max_m - y_min_m) / columns;
  const double radius_m = 0.5 * hypotenuse(kCell_m, column_m);
  station_m_.clear();
  double highest_1_m = 0, before_1_m = 1;
  const auto first = static_cast<std::int64_t>(std::floor((s_m + span.s_min_m) / kCell_m));
  const auto last = static_cast<std::int64_t>(std::ceil((s_m + span.s_max_m) / kCell_m));
  for (std::int64_t cell = first; cell < last; ++cell) {
    const double from_m = static_cast<double>(cell) * kCell_m;
    double bound_1_m = 0;
    for (int column = 0; column < columns && !fields_.empty(); ++column) {
      const double y_m = y_min_m + (column + 0.5) * column_m;
      bound_1_m = std::max(bound_1_m, curvature_1_m(fields_, disc(from_m + 0.5 * kCell_m - s_m, y_m, radius_m)));
    }
    // A run of flat cells is one chord.
    if (bound_1_m > 0 || before_1_m > 0) station_m_.push_back(from_m);
    before_1_m = bound_1_m;
    highest_1_m = std::max(highest_1_m, bound_1_m);
    if (bound_1_m == 0) continue;
    const double spacing_m = std::max(kMinSpacing_m, chord_m(bound_1_m, kChordError_m));
    const int parts = static_cast<int>(std::ceil(kCell_m / spacing_m));
    for (int i = 1; i < parts; ++i) station_m_.push_back(from_m + kCell_m * i / parts);
  }
  station_m_.push_back(static_cast<double>(last) * kCell_m);
  lines_ = 2;
  if (highest_1_m > 0) {
    const double gaps = std::ceil((across.to_m - across.from_m) / chord_m(highest_1_m, kLineError_m));
    lines_ = 1 + std::min(kMaxLines - 1, static_cast<std::size_t>(std::max(1.0, gaps)));
  }
  check_heights(static_cast<double>(station_m_.size() * lines_ * fields_.size()));
}

// Samples the planned stations on all lines and takes, station by station, the highest line's height as the profile.
// Its range across: from the first to the last line that is within tolerance_m of the highest.
void GroundOutline::cut(const SliceFrame& frame, double s_m, const LateralSpan& across, double tolerance_m,
                        Profile& profile) {
  const auto [s, c] = sine_and_cosine(frame.heading_rad);
  const std::size_t count = station_m_.size();
  relative_m_.resize(count);
  for (std::size_t i = 0; i < count; ++i) relative_m_[i] = station_m_[i] - s_m;
  const double gap_m = (across.to_m - across.from_m) / static_cast<double>(lines_ - 1);
  line_z_m_.resize(lines_);
  constexpr double kLowest = std::numeric_limits<double>::lowest();
  tops_.assign(count, {kLowest, 0, kLowest});
  auto across_of = [&](std::size_t line) { return across.from_m + gap_m * static_cast<double>(line); };
  for (std::size_t line = 0; line < lines_; ++line) {
    const double y_m = across.middle_m + across.scale * across_of(line);
    std::vector<double>& z_m = line_z_m_[line];
    z_m.assign(count, -across.tilt * across_of(line));
    const Ray ray{frame.x_m - s * y_m, frame.y_m + c * y_m, c, s};
    for (const GroundField* field : fields_) field->add_along(ray, relative_m_, z_m);
    for (std::size_t i = 0; i < count; ++i) tops_[i].z_m = std::max(tops_[i].z_m, z_m[i]);
  }
  for (std::size_t line = lines_; line-- > 0;) {
    for (std::size_t i = 0; i < count; ++i) {
      Top& top = tops_[i];
      if (line_z_m_[line][i] < top.z_m - tolerance_m) continue;
      top.across_min_m = across_of(line);
      top.across_max_m = std::max(top.across_max_m, across_of(line));
    }
  }
  profile.clear();
  for (std::size_t i = 0; i + 1 < count; ++i) {
    const Top &a = tops_[i], &b = tops_[i + 1];
    profile.push_back({relative_m_[i], relative_m_[i + 1], a.z_m, b.z_m, 0.5 * (a.across_min_m + b.across_min_m),
                       0.5 * (a.across_max_m + b.across_max_m)});
  }
}

// Returns the heights of the first and the last line at s_m, interpolated between stations.
GroundOutline::Ends GroundOutline::ends(double s_m) const {
  const auto next = std::clamp(std::upper_bound(station_m_.begin(), station_m_.end(), s_m), station_m_.begin() + 1,
                               station_m_.end() - 1);
  const auto i = static_cast<std::size_t>(next - station_m_.begin());
  const double share = std::clamp((s_m - station_m_[i - 1]) / (station_m_[i] - station_m_[i - 1]), 0.0, 1.0);
  auto height_m = [&](const std::vector<double>& z_m) { return z_m[i - 1] + share * (z_m[i] - z_m[i - 1]); };
  return {height_m(line_z_m_.front()), height_m(line_z_m_.back())};
}

}  // namespace foldcar
