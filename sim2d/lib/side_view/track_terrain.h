// The terrain of the plane: the outlines under the left wheels, the right wheels and the belly, cut anew from the
// scene's terrain as the car turns, rolls and drives.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "ground_outline.h"
#include "mechanism.h"
#include "profile.h"
#include "terrain.h"

namespace foldcar {

// Pose of the car for which the terrain is cut: frame in the world, s_m the position of its centre of mass in the
// plane, q the sine of roll.
struct CutPose {
  SliceFrame frame;
  double s_m = 0;
  double q = 0;
};

// Holds the outlines of the last cut and the chain fixtures made of them.
class TrackTerrain {
 public:
  // terrain must outlive it.
  TrackTerrain(const Terrain& terrain, const BodySpec& body, const CarConstants& constants);

  // True if the car has moved so far since the last cut that the outlines no longer fit.
  bool stale(const CutPose& pose) const;
  // Cuts all three outlines at pose; s of the result is relative to the car. Does not touch Box2D.
  void cut(const CutPose& pose);
  // Replaces those fixtures of mechanism that no longer fit the outlines of the last cut.
  void apply(Mechanism& mechanism);

  // Outline under the wheels of side k, and under the belly, of the last cut.
  const Profile& wheels(int k) const { return profiles_[k]; }
  const Profile& belly() const { return profiles_[2]; }
  // Slope (rise over run, positive up to the left) of the smooth ground across the tyre of side k at s_m of the plane;
  // 0 without smooth ground, and for a contact at a height z_m above it, where the wheel stands on a block.
  double side_slope(int k, double s_m, double z_m) const;
  // Distance to the left of the car's middle (m) at which the belly touches at s_m of the plane.
  double belly_contact_y_m(double s_m) const;

 private:
  void set_strips(double q);
  // The lines of the ground under the wheels of a side, or under the belly, at roll q.
  LateralSpan across(int outline, double q) const;
  // Whether the car at pose reaches beyond the stations planned on the smooth ground.
  bool outside_plan(const CutPose& pose) const;
  void cut_ground(const CutPose& pose, const Span& span);
  void make_vertices(const b2Body& body, const Profile& profile);
  bool reaches(const std::vector<b2Vec2>& chain) const;
  bool fits(const std::vector<b2Vec2>& chain, double tolerance_m) const;
  void adjust(int outline, b2Body& body);
  void replace_chain(int outline, b2Body& body, std::uint16_t category, std::uint16_t meets);

  const Terrain& terrain_;
  double track_m_, tyre_width_m_, belly_width_m_, belly_drop_m_, reach_m_;
  bool cut_once_ = false;
  CutPose at_;
  std::vector<Strip> strips_;
  std::vector<std::vector<Piece>> pieces_;
  std::vector<Piece> belly_pieces_;
  EnvelopeScratch scratch_;
  std::array<GroundOutline, 3> grounds_;  // used if the terrain has a ground
  CutPose planned_at_;
  Span planned_m_{1, -1};  // of the plane; none at first
  std::array<Profile, 3> profiles_;
  std::vector<b2Vec2> vertices_;               // of the outline being applied, right to left, in its body's frame
  std::array<std::vector<b2Vec2>, 3> chains_;  // what the fixtures are made of
  std::array<b2Fixture*, 3> fixtures_{};
};

}  // namespace foldcar
