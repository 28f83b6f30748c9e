// The highest line of the smooth ground under one wheel or the belly, as a profile with vertices at stations along s.
//
// The distances of the stations along s and of the sampled lines across are planned from the fields' curvature, so that
// the profile is within 0.1 mm of the ground. The stations keep their positions in the plane while the car drives over
// them; only their heights follow its heading and lateral motion. A plan holds for cuts whose pose differs by no more
// than kPlanSideways_m and kPlanTurn_rad.
#pragma once

#include <cstddef>
#include <vector>

#include "ground.h"
#include "profile.h"
#include "terrain.h"

namespace foldcar {

// Largest lateral shift and turn of a cut's pose against that of the plan.
constexpr double kPlanSideways_m = 0.005;
constexpr double kPlanTurn_rad = 0.03;

// Largest number of heights of one cut, stations × lines × pieces of ground that overlap there: it bounds the computing
// time of a step.
constexpr double kMostHeights = 300000;

// A range of lines parallel to s, told by their lateral coordinate on the car, from from_m to to_m. The line of
// coordinate a runs at y = middle_m + scale·a of the car's frame, and its heights are lowered by tilt·a.
struct LateralSpan {
  double from_m = 0;
  double to_m = 0;
  double middle_m = 0;
  double scale = 1;
  double tilt = 0;
};

// The plan for one wheel track or the belly, and its last cut.
class GroundOutline {
 public:
  // Plans the stations of the span, which is counted from the frame's point, and the lines. That point is at s_m of the
  // plane. ground must outlive the outline. Throws std::runtime_error if a cut would take more than kMostHeights.
  void plan(const Ground& ground, const SliceFrame& frame, double s_m, const Span& span, const LateralSpan& across);
  // Fills profile with the highest line at every station. y_min and y_max of its segments are the lateral coordinates
  // between which lines are within tolerance_m of the highest.
  void cut(const SliceFrame& frame, double s_m, const LateralSpan& across, double tolerance_m, Profile& profile);
  // Heights (m) of the two outermost lines of the last cut at s_m of the plane.
  struct Ends {
    double from_z_m, to_z_m;
  };
  Ends ends(double s_m) const;
  // The stations' span, counted from s_m of the plane.
  Span span(double s_m) const { return {station_m_.front() - s_m, station_m_.back() - s_m}; }

 private:
  struct Top {
    double z_m, across_min_m, across_max_m;
  };

  std::vector<const GroundField*> fields_;  // that count here
  std::vector<double> station_m_;           // in the plane
  std::size_t lines_ = 2;
  std::vector<double> relative_m_;          // from the frame
  std::vector<std::vector<double>> line_z_m_;
  std::vector<Top> tops_;
};

}  // namespace foldcar
