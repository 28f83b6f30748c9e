// The ground under a car that keeps its heading, as fixtures of Box2D's world in the car's side plane.
//
// x runs along the start's heading from the start's point, z up. Wheels meet the highest line under both tracks, bellies
// the highest under the belly: as neither rolls nor turns, these outlines hold for the whole run. They are chains, whose
// vertices know their neighbours: of pieces one by one a body would meet the ends, inside others, as walls.
#pragma once

#include <box2d/box2d.h>

#include <array>
#include <cstdint>

#include "body_spec.h"
#include "ground_outline.h"
#include "scene_spec.h"
#include "terrain.h"

namespace foldcar {

// What a fixture is, as Box2D's category bits: parts of the car meet only the ground that is theirs.
enum FixtureBits : uint16 { kWheelBit = 1, kBellyBit = 2, kWheelGroundBit = 4, kBellyGroundBit = 8 };

class SideViewGround {
 public:
  // terrain must outlive it; the fixtures are the world's.
  SideViewGround(b2World& world, const BodySpec& body, const SceneSpec& scene, const Terrain& terrain);

  // Adds the ground of hills, potholes and rough ground between these x where it is missing; the car must not reach
  // beyond it. Throws std::runtime_error if it takes too many heights.
  void extend(double x_min_m, double x_max_m);
  const b2Body& body() const { return *body_; }
  // World coordinates of a point of the plane on the line y_m to the left of the middle.
  Vec3 to_world(double x_m, double y_m) const;

 private:
  // Lines to the left of the middle between which the outline is the highest, and the parts that stand on it.
  struct Strip {
    double y_min_m, y_max_m;
    FixtureBits bits;
  };
  void add_blocks(const CourseSpec& course, FixtureBits bits);
  void add_piece(std::int64_t index);
  void add_fixture(const b2Shape& shape, FixtureBits bits);

  const Terrain& terrain_;
  const SliceFrame frame_;
  const double cosine_, sine_;  // of its heading
  std::array<Strip, 3> strips_;
  b2Body* body_;
  std::int64_t first_ = 0, end_ = 0;  // pieces of the smooth ground that are there
};

}  // namespace foldcar
