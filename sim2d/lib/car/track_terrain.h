// Keeps the terrain that the three outlines of the plane stand for: cut anew as the car turns, rolls and drives.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "ground_outline.h"
#include "mechanism.h"
#include "profile.h"
#include "terrain.h"

namespace foldcar {

// Where the car is when the terrain is cut. s_m is its centre of mass in the plane, frame its pose in the world.
struct CutPose {
  SliceFrame frame;
  double s_m = 0;
  double q = 0;
};

class TrackTerrain {
 public:
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
  // How steeply the smooth ground under the wheels of side k rises to the left at s and z of the plane; 0 where there is
  // none, and above it, where a wheel stands on something else.
  double side_slope(int k, double s_m, double z_m) const;
  // Where across the car (y, metres) the belly touches at s_m of the plane.
  double belly_contact_y_m(double s_m) const;

 private:
  void set_strips(double q);
  // What the wheels of side k stand on, or the belly sees, of the ground at roll q.
  Across across(int outline, double q) const;
  // Smooth ground's stations serve as long as the car stands on their span.
  bool beyond_plan(const CutPose& pose) const;
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
