#include "side_view_ground.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "box2d_units.h"

namespace foldcar {
namespace {

// The smooth ground is made in pieces of this length, each with this much more at its ends, whose vertices tell Box2D
// how it goes on. Both are multiples of the distance at which outlines always have a vertex.
constexpr double kPiece_m = 0.4;
constexpr double kMore_m = 0.02;
// Ends are told from vertices by this.
constexpr double kSame_m = 1e-4;
// Blocks reach this far below z = 0.
constexpr double kSunk_m = 0.02;

double distance_m(const SliceFrame& frame, double x_m, double y_m) {
  return std::hypot(x_m - frame.x_m, y_m - frame.y_m);
}

// Points of a block between two lines, in the frame: its corners, and where its edges cross the lines.
std::vector<Vec3> points_between(const Solid& solid, const SliceFrame& frame, double y_min_m, double y_max_m) {
  const double c = std::cos(frame.heading_rad), s = std::sin(frame.heading_rad);
  const auto to_frame = [&](const Vec3& at_m) {
    const double dx = at_m.x - frame.x_m, dy = at_m.y - frame.y_m;
    return Vec3{c * dx + s * dy, c * dy - s * dx, at_m.z};
  };
  std::vector<Vec3> points;
  for (const Solid::Corner& corner : solid.tops) {
    const Vec3 at_m = to_frame(corner.at_m);
    if (at_m.y >= y_min_m && at_m.y <= y_max_m) points.push_back(at_m);
  }
  for (const Solid::Edge& edge : solid.edges) {
    const Vec3 from_m = to_frame(edge.from_m), to_m = to_frame(edge.to_m);
    for (const double y_m : {y_min_m, y_max_m}) {
      if ((from_m.y < y_m) == (to_m.y < y_m)) continue;
      const Vec3 at_m = from_m + (y_m - from_m.y) / (to_m.y - from_m.y) * (to_m - from_m);
      if (at_m.z >= 0) points.push_back(at_m);
    }
  }
  return points;
}

// The upper side of the points' convex hull, from right to left, by the monotone chain; vertices that Box2D would merge
// are left out.
std::vector<b2Vec2> upper_hull(std::vector<Vec3> points) {
  std::sort(points.begin(), points.end(),
            [](const Vec3& a, const Vec3& b) { return a.x > b.x || (a.x == b.x && a.z < b.z); });
  std::vector<b2Vec2> hull;
  for (const Vec3& point : points) {
    const b2Vec2 next = to_units(point.x, point.z);
    while (hull.size() > 1 && b2Cross(hull.back() - hull[hull.size() - 2], next - hull.back()) <= 0) hull.pop_back();
    if (hull.empty() || b2DistanceSquared(hull.back(), next) > b2_linearSlop * b2_linearSlop) hull.push_back(next);
  }
  return hull;
}

}  // namespace

SideViewGround::SideViewGround(b2World& world, const BodySpec& body, const SceneSpec& scene, const Terrain& terrain)
    : terrain_(terrain),
      frame_{scene.start.x_m, scene.start.y_m, scene.start.heading_rad},
      cosine_(std::cos(frame_.heading_rad)),
      sine_(std::sin(frame_.heading_rad)) {
  double tyre_width_m = 0, belly_width_m = 0;
  for (const WheelSpec& wheel : body.wheels) tyre_width_m = std::max(tyre_width_m, wheel.width_m);
  for (const SegmentSpec& segment : body.segments) belly_width_m = std::max(belly_width_m, segment.width_m);
  const double inner_m = 0.5 * (body.track_m - tyre_width_m), outer_m = 0.5 * (body.track_m + tyre_width_m);
  strips_ = {Strip{inner_m, outer_m, kWheelGroundBit}, Strip{-outer_m, -inner_m, kWheelGroundBit},
             Strip{-0.5 * belly_width_m, 0.5 * belly_width_m, kBellyGroundBit}};
  b2BodyDef still;
  // With its skin the ground is as high as it should be.
  still.position.y = -b2_polygonRadius;
  body_ = world.CreateBody(&still);
  for (const Solid& solid : terrain.solids()) {
    for (const Strip& strip : strips_) add_block(solid, strip);
  }
  if (terrain.ground() != nullptr) return;
  const CourseSpec& course = scene.course;
  double far_m = 1;
  for (const double x_m : {course.x_min_m, course.x_max_m}) {
    for (const double y_m : {course.y_min_m, course.y_max_m}) far_m = std::max(far_m, 1 + distance_m(frame_, x_m, y_m));
  }
  b2EdgeShape level;
  level.SetOneSided(to_units(far_m + 1, 0), to_units(far_m, 0), to_units(-far_m, 0), to_units(-far_m - 1, 0));
  add_fixture(level, static_cast<FixtureBits>(kWheelGroundBit | kBellyGroundBit));
}

Vec3 SideViewGround::to_world(double x_m, double y_m) const {
  return {frame_.x_m + cosine_ * x_m - sine_ * y_m, frame_.y_m + sine_ * x_m + cosine_ * y_m, 0};
}

// A polygon, or where that had too many vertices for Box2D, their chain.
void SideViewGround::add_block(const Solid& solid, const Strip& strip) {
  std::vector<b2Vec2> outline = upper_hull(points_between(solid, frame_, strip.y_min_m, strip.y_max_m));
  if (outline.size() < 2) return;
  outline.insert(outline.begin(), {outline.front().x, to_units(-kSunk_m)});
  outline.push_back({outline.back().x, to_units(-kSunk_m)});
  const auto count = static_cast<int32>(outline.size());
  if (count <= b2_maxPolygonVertices) {
    b2PolygonShape polygon;
    polygon.Set(outline.data(), count);
    add_fixture(polygon, strip.bits);
  } else {
    b2ChainShape chain;
    chain.CreateLoop(outline.data(), count);
    add_fixture(chain, strip.bits);
  }
}

void SideViewGround::extend(double x_min_m, double x_max_m) {
  if (terrain_.ground() == nullptr) return;
  const auto first = static_cast<long>(std::floor(x_min_m / kPiece_m));
  const auto end = static_cast<long>(std::ceil(x_max_m / kPiece_m));
  if (first_ == end_) first_ = end_ = first;
  while (first_ > first) add_piece(--first_);
  while (end_ < end) add_piece(end_++);
}

void SideViewGround::add_piece(long index) {
  const double x_m = static_cast<double>(index) * kPiece_m;
  const Vec3 at_m = to_world(x_m, 0);
  const SliceFrame frame{at_m.x, at_m.y, frame_.heading_rad};
  for (const Strip& strip : strips_) {
    const double half_m = 0.5 * (strip.y_max_m - strip.y_min_m);
    const LateralSpan across{-half_m, half_m, 0.5 * (strip.y_min_m + strip.y_max_m), 1, 0};
    GroundOutline outline;
    Profile profile;
    outline.plan(*terrain_.ground(), frame, x_m, {-kMore_m, kPiece_m + kMore_m}, across);
    outline.cut(frame, x_m, across, 0, profile);
    // From right to left. A chord over level ground may go beyond both ends, which become vertices.
    std::vector<b2Vec2> vertices;
    const auto add = [&](double s_m, double z_m) { vertices.push_back(to_units(x_m + s_m, z_m)); };
    std::size_t first = 0, end = 0;
    add(profile.back().s1_m, profile.back().z1_m);
    for (auto segment = profile.rbegin(); segment != profile.rend(); ++segment) {
      for (const double s_m : {kPiece_m, 0.0}) {
        if (s_m < segment->s0_m + kSame_m || s_m > segment->s1_m - kSame_m) continue;
        const double share = (s_m - segment->s0_m) / (segment->s1_m - segment->s0_m);
        add(s_m, segment->z0_m + share * (segment->z1_m - segment->z0_m));
      }
      add(segment->s0_m, segment->z0_m);
    }
    const float left = to_units(x_m - kSame_m), right = to_units(x_m + kPiece_m + kSame_m);
    while (vertices[first].x > right) ++first;
    for (end = first; vertices[end].x > left; ++end) {
    }
    b2ChainShape chain;
    chain.CreateChain(&vertices[first], static_cast<int32>(end - first), vertices[first - 1], vertices[end]);
    add_fixture(chain, strip.bits);
  }
}

void SideViewGround::add_fixture(const b2Shape& shape, FixtureBits bits) {
  b2FixtureDef fixture;
  fixture.shape = &shape;
  fixture.filter.categoryBits = bits;
  fixture.filter.maskBits = kWheelBit | kBellyBit;
  body_->CreateFixture(&fixture);
}

}  // namespace foldcar
