// The ground in the plane: the outlines under the left wheels, the right wheels and the belly, cut anew from the scene's
// terrain as the car turns, rolls and drives.
//
// An outline is the highest of several lines across a tyre or the belly. A leaning car's lines differ in height: that at
// y to the left of the tyre's or the belly's middle is higher by y sin(roll), which is taken off the ground below it.
#pragma once

#include <box2d/box2d.h>

#include <array>
#include <vector>

#include "body_spec.h"
#include "car_constants.h"
#include "ground_outline.h"
#include "profile.h"
#include "terrain.h"

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
  // terrain must outlive it.
  TrackTerrain(const Terrain& terrain, const BodySpec& body, const CarConstants& constants);

  // True if the car has moved so far since the last cut that the outlines no longer fit.
  bool stale(const CutPose& pose) const;
  // Cuts all three outlines at pose; s of the result is relative to the car.
  void cut(const CutPose& pose);
  const CutPose& at() const { return at_; }  // the last cut's

  // Outline under the wheels of side k, and under the belly, of the last cut.
  const Profile& wheels(int k) const { return profiles_[k]; }
  const Profile& belly() const { return profiles_[2]; }
  // Edges of outline 0 (left), 1 (right) or 2 (belly), and its lines across.
  const std::vector<OutlineEdge>& edges(int outline) const { return edges_[outline]; }
  LateralSpan across(int outline) const { return across(outline, at_.q); }
  // Slope (rise over run, positive up to the left) of the smooth ground across the tyre of side k at s_m from the last
  // cut; 0 without smooth ground, and for a contact at a height z_m above it, where the wheel stands on a block.
  double side_slope(int k, double s_m, double z_m) const;

 private:
  void set_strips(double q);
  // The lines of the ground under the wheels of a side, or under the belly, at roll q.
  LateralSpan across(int outline, double q) const;
  // Whether the car at pose reaches beyond the stations planned on the smooth ground.
  bool outside_plan(const CutPose& pose) const;
  void cut_ground(const CutPose& pose, const Span& span);
  void cut_outline(int outline, const Span& span, bool level);
  void make_edges(int outline);

  const Terrain& terrain_;
  double track_m_, tyre_width_m_, belly_width_m_, belly_drop_m_, reach_m_;
  bool cut_once_ = false;
  CutPose at_;
  std::vector<Strip> strips_;
  std::vector<std::vector<Piece>> pieces_;
  std::vector<Piece> lowered_;
  EnvelopeScratch scratch_;
  std::array<GroundOutline, 3> grounds_;  // used if the terrain has a ground
  CutPose planned_at_;
  Span planned_m_{1, -1};  // of the plane; none at first
  std::array<Profile, 3> profiles_;
  std::array<std::vector<OutlineEdge>, 3> edges_;
};

}  // namespace foldcar
