// The ground's highest line under one wheel or the belly, as a profile with vertices at stations along s.
//
// Stations and the lines sampled between them are planned from the fields' curvature, so that the profile is right
// within a tenth of a millimetre; they stay where they are in the plane while the car drives over them, and only
// their heights follow its heading and its drift. What is planned serves cuts that differ from it by no more than
// kPlanSideways and kPlanTurn.
#pragma once

#include <cstddef>
#include <vector>

#include "ground.h"
#include "profile.h"
#include "terrain.h"

namespace foldcar {

constexpr double kPlanSideways_m = 0.005;
constexpr double kPlanTurn_rad = 0.03;

// Lines of the car's frame, parallel to s: that of across (in the car) runs at y = middle + scale·across and is seen
// lowered by tilt·across.
struct Across {
  double from_m = 0;
  double to_m = 0;
  double middle_m = 0;
  double scale = 1;
  double tilt = 0;
};

class GroundOutline {
 public:
  // Chooses stations for the span, which counts from the frame's point; that point stands at s_m of the plane.
  void plan(const Ground& ground, const SliceFrame& frame, double s_m, const Span& span, const Across& across);
  // The highest of all lines at every station; y of the segments is across, where lines are as high as the highest
  // within tolerance_m.
  void cut(const SliceFrame& frame, double s_m, const Across& across, double tolerance_m, Profile& profile);
  // How high the outermost lines of the last cut are at s of the plane.
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
