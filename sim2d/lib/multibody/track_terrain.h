// The smooth ground in the plane: its outlines under the left wheels, the right wheels and the belly, cut anew as the car
// turns, rolls and drives.
//
// An outline is the highest of several lines across a tyre or the belly. A leaning car's lines differ in height: that at
// y to the left of the tyre's or the belly's middle is higher by y sin(roll), which is taken off the ground below it.
#pragma once

#include <box2d/box2d.h>

#include <array>
#include <vector>

#include "body_spec.h"
#include "car_constants.h"
#include "ground.h"
#include "ground_outline.h"
#include "profile.h"

namespace foldcar {

// Pose of the car for which the terrain is cut: frame in the world, at the height of the contacts, s_m the position of
// its centre of mass in the plane, q the sine of roll.
struct CutPose {
  SliceFrame frame;
  double s_m = 0;
  double q = 0;
};

// An edge of an outline in Box2D's units, from right to left, solid below; heights are divided by cos(roll). The lines
// between y_min_m and y_max_m (to the left of the middle) carry there.
struct OutlineEdge {
  b2EdgeShape shape;
  double y_min_m, y_max_m;
};

// Holds the outlines of the last cut.
class TrackTerrain {
 public:
  // ground must outlive it.
  TrackTerrain(const Ground& ground, const BodySpec& body, const CarConstants& constants);

  // True if the car has moved so far since the last cut that the outlines no longer fit.
  bool stale(const CutPose& pose) const;
  // Cuts all three outlines at pose; s of the result is relative to the car.
  void cut(const CutPose& pose);
  const CutPose& at() const { return at_; }  // the last cut's

  // Outline 0 (left wheels), 1 (right wheels) or 2 (belly) of the last cut.
  const Profile& profile(int outline) const { return profiles_[outline]; }
  // Its edges and its lines across.
  const std::vector<OutlineEdge>& edges(int outline) const { return edges_[outline]; }
  LateralSpan across(int outline) const { return across(outline, at_.q); }
  // Slope (rise over run, positive up to the left) of the smooth ground across the tyre of side k at s_m from the last
  // cut.
  double side_slope(int k, double s_m) const;

 private:
  // The lines of the ground under the wheels of a side, or under the belly, at roll q.
  LateralSpan across(int outline, double q) const;
  // Whether the car at pose reaches beyond the stations planned on the smooth ground.
  bool outside_plan(const CutPose& pose) const;
  void plan(const CutPose& pose);
  void make_edges(int outline);

  const Ground& ground_;
  double track_m_, tyre_width_m_, belly_width_m_, belly_drop_m_, reach_m_;
  bool cut_once_ = false;
  CutPose at_;
  std::array<GroundOutline, 3> grounds_;
  CutPose planned_at_;
  Span planned_m_{1, -1};  // of the plane; none at first
  std::array<Profile, 3> profiles_;
  std::array<std::vector<OutlineEdge>, 3> edges_;
};

}  // namespace foldcar
