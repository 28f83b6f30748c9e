#include "side_view_ground.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "box2d_units.h"
#include "elementary_functions.h"

namespace foldcar {
namespace {

// Smooth ground is made in pieces of kPiece_m. Each is cut kMore_m longer at both ends, because Box2D wants the next
// vertex beyond an end. Both are multiples of the distance at which outlines always have a vertex.
constexpr double kPiece_m = 0.4;
constexpr double kMore_m = 0.02;
// Points nearer than this along x are the same place; a surface that extends less along x is a wall.
constexpr double kSame_m = 1e-4;
// Box2D would merge vertices nearer than this, in its units.
constexpr float kLeast = 1.5F * b2_linearSlop;
// Blocks reach this far below z = 0.
constexpr double kSunk_m = 0.02;
// Sorts are stable, because the outline's last bits depend on the order of elements that compare equal, as lines that
// begin at one place, or 0 and -0.

double distance_m(const SliceFrame& frame, double x_m, double y_m) {
  return hypotenuse(x_m - frame.x_m, y_m - frame.y_m);
}

// Returns the points that bound the part of a block between two lines along the track, y_min_m and y_max_m in the
// frame: its upper corners there, and where its edges cross the lines.
std::vector<Vec3> points_between(const Solid& solid, const SliceFrame& frame, double y_min_m, double y_max_m) {
  // No structured binding: a lambda may capture one only from C++20 on.
  const SineCosine turn = sine_and_cosine(frame.heading_rad);
  const auto to_frame = [&](const Vec3& at_m) {
    const double dx = at_m.x - frame.x_m, dy = at_m.y - frame.y_m;
    return Vec3{turn.cosine * dx + turn.sine * dy, turn.cosine * dy - turn.sine * dx, at_m.z};
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

// A straight piece of a surface, from left to right.
struct Line {
  double x0_m, z0_m, x1_m, z1_m;
  double z_m(double x_m) const { return z0_m + (x_m - x0_m) / (x1_m - x0_m) * (z1_m - z0_m); }
};

// Adds the upper side of the convex hull of the points, seen from the side (x, z), as lines from left to right.
// Andrew's monotone chain: in order of x, drop each point that lies on or below the line from the point before it to
// the next.
void add_upper_hull(std::vector<Vec3> points, std::vector<Line>& lines) {
  std::stable_sort(points.begin(), points.end(),
                   [](const Vec3& a, const Vec3& b) { return a.x < b.x || (a.x == b.x && a.z < b.z); });
  std::vector<Vec3> hull;
  for (const Vec3& next : points) {
    const auto above = [&](const Vec3& a, const Vec3& b) {
      return (b.x - a.x) * (next.z - b.z) - (b.z - a.z) * (next.x - b.x) >= 0;
    };
    while (hull.size() > 1 && above(hull[hull.size() - 2], hull.back())) hull.pop_back();
    hull.push_back(next);
  }
  for (std::size_t i = 1; i < hull.size(); ++i) {
    if (hull[i].x - hull[i - 1].x > kSame_m) lines.push_back({hull[i - 1].x, hull[i - 1].z, hull[i].x, hull[i].z});
  }
}

// Returns, sorted, every x at which another line may become the highest: the lines' ends and where two cross.
std::vector<double> changes_of(const std::vector<Line>& lines) {
  std::vector<double> at_m;
  for (auto one = lines.begin(); one != lines.end(); ++one) {
    at_m.push_back(one->x0_m);
    at_m.push_back(one->x1_m);
    for (auto other = one + 1; other != lines.end() && other->x0_m < one->x1_m; ++other) {
      const double from_m = other->x0_m, to_m = std::min(one->x1_m, other->x1_m);
      const double first = one->z_m(from_m) - other->z_m(from_m), last = one->z_m(to_m) - other->z_m(to_m);
      if ((first < 0) != (last < 0)) at_m.push_back(from_m + first / (first - last) * (to_m - from_m));
    }
  }
  std::stable_sort(at_m.begin(), at_m.end());
  return at_m;
}

// Returns the upper envelope of the lines, from left to right, as vertices in Box2D's units: between two changes one
// line is the highest. A gap without lines ends an outline; the next line begins another.
std::vector<std::vector<b2Vec2>> highest(std::vector<Line> lines) {
  std::stable_sort(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.x0_m < b.x0_m; });
  const std::vector<double> at_m = changes_of(lines);
  std::vector<std::vector<b2Vec2>> outlines;
  std::vector<Line> here;
  auto next = lines.begin();
  bool goes_on = false;
  for (std::size_t i = 1; i < at_m.size(); ++i) {
    const double from_m = at_m[i - 1], to_m = at_m[i], middle_m = 0.5 * (from_m + to_m);
    for (; next != lines.end() && next->x0_m <= from_m; ++next) here.push_back(*next);
    const auto is_over = [&](const Line& one) { return one.x1_m <= from_m; };
    here.erase(std::remove_if(here.begin(), here.end(), is_over), here.end());
    if (to_m <= from_m) continue;
    const auto top = std::max_element(here.begin(), here.end(), [&](const Line& a, const Line& b) {
      return a.z_m(middle_m) < b.z_m(middle_m);
    });
    if (top == here.end()) {
      goes_on = false;
      continue;
    }
    if (!goes_on) outlines.emplace_back();
    goes_on = true;
    for (const double x_m : {from_m, to_m}) {
      const b2Vec2 vertex = to_units(x_m, top->z_m(x_m));
      std::vector<b2Vec2>& outline = outlines.back();
      if (outline.empty() || b2DistanceSquared(outline.back(), vertex) > kLeast * kLeast) outline.push_back(vertex);
    }
  }
  return outlines;
}

}  // namespace

SideViewGround::SideViewGround(b2World& world, const BodySpec& body, const SceneSpec& scene, const Terrain& terrain)
    : terrain_(terrain),
      frame_{scene.start.x_m, scene.start.y_m, scene.start.heading_rad},
      cosine_(cosine(frame_.heading_rad)),
      sine_(sine(frame_.heading_rad)) {
  double tyre_width_m = 0, belly_width_m = 0;
  for (const WheelSpec& wheel : body.wheels) tyre_width_m = std::max(tyre_width_m, wheel.width_m);
  for (const SegmentSpec& segment : body.segments) belly_width_m = std::max(belly_width_m, segment.width_m);
  const double inner_m = 0.5 * (body.track_m - tyre_width_m), outer_m = 0.5 * (body.track_m + tyre_width_m);
  strips_ = {Strip{inner_m, outer_m, kWheelGroundBit}, Strip{-outer_m, -inner_m, kWheelGroundBit},
             Strip{-0.5 * belly_width_m, 0.5 * belly_width_m, kBellyGroundBit}};
  b2BodyDef still;
  body_ = world.CreateBody(&still);
  for (const FixtureBits bits : {kWheelGroundBit, kBellyGroundBit}) add_blocks(scene.course, bits);
}

Vec3 SideViewGround::to_world(double x_m, double y_m) const {
  return {frame_.x_m + cosine_ * x_m - sine_ * y_m, frame_.y_m + sine_ * x_m + cosine_ * y_m, 0};
}

// Adds the upper envelope of all blocks below the wheels or the bellies (bits) to Box2D's world, with the level floor,
// if any. One envelope, as wheels would catch on edges that lie on each other or inside a block.
void SideViewGround::add_blocks(const CourseSpec& course, FixtureBits bits) {
  std::vector<Line> lines;
  const bool level = terrain_.ground() == nullptr;
  if (level) {
    double far_m = 1;
    for (const double x_m : {course.x_min_m, course.x_max_m}) {
      for (const double y_m : {course.y_min_m, course.y_max_m}) {
        far_m = std::max(far_m, 1 + distance_m(frame_, x_m, y_m));
      }
    }
    lines.push_back({-far_m, 0, far_m, 0});
  }
  for (const Strip& strip : strips_) {
    if (strip.bits != bits) continue;
    for (const Solid& solid : terrain_.solids()) {
      add_upper_hull(points_between(solid, frame_, strip.y_min_m, strip.y_max_m), lines);
    }
  }
  for (std::vector<b2Vec2>& outline : highest(lines)) {
    // Blocks on smooth ground reach into it.
    if (!level) {
      outline.insert(outline.begin(), {outline.front().x, to_units(-kSunk_m)});
      outline.push_back({outline.back().x, to_units(-kSunk_m)});
    }
    // Box2D's surfaces are on the right of a chain's direction.
    std::reverse(outline.begin(), outline.end());
    const b2Vec2 on = level ? b2Vec2(1, 0) : b2Vec2(0, -1);
    b2ChainShape chain;
    chain.CreateChain(outline.data(), static_cast<int32>(outline.size()), outline.front() + on,
                      outline.back() + (level ? -on : on));
    add_fixture(chain, bits);
  }
}

// Adds the pieces of smooth ground that are still missing between x_min_m and x_max_m.
void SideViewGround::extend(double x_min_m, double x_max_m) {
  if (terrain_.ground() == nullptr) return;
  const auto first = static_cast<std::int64_t>(std::floor(x_min_m / kPiece_m));
  const auto end = static_cast<std::int64_t>(std::ceil(x_max_m / kPiece_m));
  if (first_ == end_) first_ = end_ = first;
  while (first_ > first) add_piece(--first_);
  while (end_ < end) add_piece(end_++);
}

// Adds the smooth ground from index · kPiece_m on, kPiece_m long, as one chain for each strip below wheels and belly.
// The vertices before and after the chain's ends tell Box2D how the ground goes on.
void SideViewGround::add_piece(std::int64_t index) {
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
  // The ground has no skin: edges stay sharp, walls where they are.
  body_->CreateFixture(&fixture)->GetShape()->m_radius = 0;
}

}  // namespace foldcar
