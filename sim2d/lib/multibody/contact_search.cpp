#include "contact_search.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <string>

#include "belly_contacts.h"
#include "box2d_units.h"
#include "elementary_functions.h"
#include "scene_terrain.h"
#include "tyre_contacts.h"

namespace foldcar {
namespace {

// The list of blocks near the car is made anew when the car has moved this far.
constexpr double kNearTolerance_m = 0.05;

// Vertical plane along the car's heading, in which the ground is cut to an outline and wheels meet it as circles.
// Heights are divided by the cosine of the roll for which it was cut, so that a leaning wheel is a circle there too.
struct CutPlane {
  Vec3 forward, left, origin;
  double cosine, sine;  // of roll
  explicit CutPlane(const CutPose& cut) : cosine(std::sqrt(1 - cut.q * cut.q)), sine(cut.q) {
    const auto [s, c] = sine_and_cosine(cut.frame.heading_rad);
    forward = {c, s, 0};
    left = {-s, c, 0};
    origin = {cut.frame.x_m, cut.frame.y_m, 0};
  }
  b2Vec2 to_plane(const Vec3& world_m) const {
    return to_units(dot(world_m - origin, forward), world_m.z / cosine);
  }
  // A point of the outline, which is lowered by across_m times sine, on the line at across_m.
  Vec3 to_world(b2Vec2 point, double across_m, const LateralSpan& span) const {
    Vec3 world = origin + to_metres(point.x) * forward + (span.middle_m + span.scale * across_m) * left;
    world.z = to_metres(point.y) * cosine + across_m * sine;
    return world;
  }
  // The ground's unit normal in the world, from the outline's normal and the ground's rise to the left, side_slope
  // (m/m).
  Vec3 normal(b2Vec2 in_plane, double side_slope) const {
    return unit(static_cast<double>(in_plane.x) * cosine * forward +
                static_cast<double>(in_plane.y) * (Vec3{0, 0, 1} - side_slope * left));
  }
};

// Adds the contacts of a part with the ground at a point of the ground's outline: one at each end of the span across
// the car over which this edge of the outline carries. point_on_part(across_m, ground_m) is the part's point opposite
// the ground.
template <typename PointOnPart>
void add_contacts(const CutPlane& plane, const LateralSpan& span, const OutlineEdge& edge, b2Vec2 point,
                  const Vec3& normal, double margin_m, const PointOnPart& point_on_part, Contact contact,
                  std::vector<Contact>& contacts) {
  contact.normal = normal;
  for (const double across_m : {edge.y_min_m, edge.y_max_m}) {
    const Vec3 ground_m = plane.to_world(point, across_m, span);
    contact.point_m = point_on_part(across_m, ground_m);
    contact.across_m = across_m;
    contact.gap_m = dot(normal, contact.point_m - ground_m);
    if (contact.gap_m < margin_m) contacts.push_back(contact);
    if (edge.y_min_m == edge.y_max_m) return;
  }
}

}  // namespace

// The solver's result depends on which contacts remain and on their order, so nothing here is left to the C++ library.
void keep_deepest(std::vector<Contact>& contacts) {
  if (contacts.size() <= kMaxContacts) return;
  std::vector<std::size_t> kept(contacts.size());
  std::iota(kept.begin(), kept.end(), std::size_t{0});
  std::stable_sort(kept.begin(), kept.end(),
                   [&](std::size_t a, std::size_t b) { return contacts[a].gap_m < contacts[b].gap_m; });
  kept.resize(kMaxContacts);
  std::sort(kept.begin(), kept.end());
  // In place: kept[i] >= i.
  for (std::size_t i = 0; i < kMaxContacts; ++i) contacts[i] = contacts[kept[i]];
  contacts.resize(kMaxContacts);
}

ContactSearch::ContactSearch(const BodySpec& body, const CarConstants& constants, const Terrain& terrain)
    : body_(body), terrain_(terrain), reach_m_(hypotenuse(2 * constants.reach_m, body.track_m)) {}

// Finds all contacts of wheels and bellies with ground and blocks whose gap is below margin_m; ground: null if it is
// level. Sets each contact's friction direction `along`.
void ContactSearch::find(const CarDynamics& car, const TrackTerrain* ground, double margin_m,
                         std::vector<Contact>& contacts) {
  const Vec3 moved = car.position_m - near_at_m_;
  if (!near_once_ || moved.x * moved.x + moved.y * moved.y > kNearTolerance_m * kNearTolerance_m) {
    find_near(car.position_m);
  }
  contacts.clear();
  faces_ = 0;
  for (std::size_t i = 0; i < body_.wheels.size(); ++i) find_tyre(i, car, ground, margin_m, contacts);
  for (std::size_t j = 0; j < body_.segments.size(); ++j) find_belly(j, car, ground, margin_m, contacts);
  keep_deepest(contacts);
  for (Contact& contact : contacts) {
    // A wall's normal is along the axles: there the second direction is upwards.
    const Vec3 along = cross(car.turn.left, contact.normal);
    contact.along = unit(dot(along, along) > 0.1 ? along : cross(car.turn.forward, contact.normal));
  }
}

double ContactSearch::highest_m() const {
  double height_m = 0;
  for (const Solid* solid : near_) height_m = std::max(height_m, solid->top_m);
  return height_m;
}

// Lists in near_ the blocks that a car at at_m could touch, also after moving by kNearTolerance_m.
void ContactSearch::find_near(const Vec3& at_m) {
  near_once_ = true;
  near_at_m_ = at_m;
  near_.clear();
  for (const Solid& solid : terrain_.solids()) {
    if (overlap(solid.reach, {at_m.x, at_m.y, reach_m_ + kNearTolerance_m})) near_.push_back(&solid);
  }
}

// Adds the contacts of a tyre or belly (Part) with the nearby blocks. Throws if all blocks tested in this step have
// too many faces: it would take too long.
template <typename Part>
void ContactSearch::add_nearby_solid_contacts(const Part& part, const Vec3& middle, double margin_m,
                                              const Contact& contact, std::vector<Contact>& contacts) {
  const double reach_m = part.reach_m() + margin_m;
  for (const Solid* solid : near_) {
    if (middle.z > solid->top_m + reach_m || !overlap(solid->reach, {middle.x, middle.y, reach_m})) continue;
    faces_ += solid->faces.size();
    add_solid_contacts(part, *solid, margin_m, contact, contacts);
  }
  if (static_cast<double>(faces_) > kMostFaces) {
    throw std::runtime_error("scene.terrain.faces: the blocks at wheels and bellies have " + std::to_string(faces_) +
                             " faces or more, the limit is " + std::to_string(static_cast<std::int64_t>(kMostFaces)) +
                             ": let fewer blocks overlap");
  }
}

// Adds one tyre's contacts: with blocks, and with the ground, level (null) or as the outline below this side's wheels.
// There Box2D meets each edge of the outline with the wheel's circle, in the outline's plane.
void ContactSearch::find_tyre(std::size_t wheel, const CarDynamics& car, const TrackTerrain* ground, double margin_m,
                              std::vector<Contact>& contacts) {
  const WheelSpec& spec = body_.wheels[wheel];
  // The tyre's centre turns about the axle, forward through down.
  const double phase_rad = car.wheel_rad[wheel] + car.fold_rad(static_cast<std::size_t>(spec.segment)) -
                           spec.eccentricity_phase_rad;
  const auto [s, c] = sine_and_cosine(phase_rad);
  const Vec3 off{spec.eccentricity_m * c, 0, -spec.eccentricity_m * s};
  const Vec3 centre = car.position_m + car.turn.to_world(car.axle(wheel) + off);
  Contact contact;
  contact.segment = static_cast<std::size_t>(spec.segment);
  contact.wheel = static_cast<int>(wheel);
  const Tyre tyre{centre, car.turn.left, spec.radius_m, 0.5 * spec.width_m};
  add_nearby_solid_contacts(tyre, centre, margin_m, contact, contacts);
  if (ground == nullptr) return add_level_ground_contacts(tyre, margin_m, contact, contacts);
  const CutPlane plane(ground->at());
  const int outline = static_cast<int>(spec.side);
  const LateralSpan span = ground->across(outline);
  const Vec3& axis = car.turn.left;
  const b2Transform still(b2Vec2_zero, b2Rot(0));
  b2CircleShape circle;
  circle.m_p = plane.to_plane(centre);
  circle.m_radius = to_units(spec.radius_m + margin_m);
  const float reach = circle.m_radius + b2_polygonRadius;
  for (const OutlineEdge& edge : ground->edges(outline)) {
    // Edges run from right to left.
    if (edge.shape.m_vertex1.x < circle.m_p.x - reach || edge.shape.m_vertex2.x > circle.m_p.x + reach) continue;
    b2Manifold manifold;
    manifold.pointCount = 0;
    b2CollideEdgeAndCircle(&manifold, &edge.shape, still, &circle, still);
    if (manifold.pointCount == 0) continue;
    b2Vec2 point = manifold.localPoint, normal = manifold.localNormal;
    if (manifold.type == b2Manifold::e_circles) {
      // Both edges of a vertex report it: the one that begins there counts.
      if (manifold.points[0].id.cf.indexA == 1) continue;
      normal = circle.m_p - point;
      normal.Normalize();
    } else {
      point = circle.m_p - b2Dot(circle.m_p - edge.shape.m_vertex1, normal) * normal;
    }
    const double side_slope = ground->side_slope(outline, to_metres(point.x));
    const Vec3 ground_normal = plane.normal(normal, side_slope);
    const Vec3 down = unit(dot(ground_normal, axis) * axis - ground_normal);
    const auto point_on_part = [&](double across_m, const Vec3&) {
      return centre + across_m * axis + spec.radius_m * down;
    };
    add_contacts(plane, span, edge, point, ground_normal, margin_m, point_on_part, contact, contacts);
  }
}

// Adds the contacts of one segment's belly (a box): with blocks, and with the ground, level (null) or as the outline
// below the car's middle. There Box2D meets each edge of the outline with the box's side view, in the outline's plane.
void ContactSearch::find_belly(std::size_t segment, const CarDynamics& car, const TrackTerrain* ground, double margin_m,
                               std::vector<Contact>& contacts) {
  const SegmentSpec& spec = body_.segments[segment];
  const double half_length_m = 0.5 * spec.length_m, half_height_m = 0.5 * spec.height_m;
  const Vec3 middle = car.position_m + car.turn.to_world(car.place(segment, {spec.x_m, 0, spec.center_z_m}));
  const double fold_rad = car.fold_rad(segment);
  const auto [s, c] = sine_and_cosine(fold_rad);
  const Vec3 forward = c * car.turn.forward - s * car.turn.up;
  const Vec3 up = cross(forward, car.turn.left);
  Contact contact;
  contact.segment = segment;
  const Belly belly{middle, {forward, car.turn.left, up}, {half_length_m, 0.5 * spec.width_m, half_height_m}};
  add_nearby_solid_contacts(belly, middle, margin_m, contact, contacts);
  if (ground == nullptr) return add_level_ground_contacts(belly, margin_m, contact, contacts);
  const CutPlane plane(ground->at());
  const b2Vec2 at = plane.to_plane(middle);
  const float reach_x = to_units(hypotenuse(half_length_m, half_height_m) + margin_m);
  const float lowest_z =
      to_units((middle.z - half_height_m * std::abs(up.z) - half_length_m * std::abs(forward.z)) / plane.cosine -
               2 * margin_m);
  b2PolygonShape box;
  bool made = false;
  // In the box's own coordinates, in Box2D's units.
  const auto on_box = [&](b2Vec2 local, double across_m) {
    return middle + to_metres(local.x) * forward + across_m * car.turn.left + to_metres(local.y) * up;
  };
  const b2Transform still(b2Vec2_zero, b2Rot(0));
  const b2Transform placed(
      at, b2Rot(static_cast<float>(arc_tangent(forward.z / plane.cosine, dot(forward, plane.forward)))));
  for (const OutlineEdge& edge : ground->edges(2)) {
    if (std::max(edge.shape.m_vertex1.y, edge.shape.m_vertex2.y) < lowest_z ||
        edge.shape.m_vertex1.x < at.x - reach_x || edge.shape.m_vertex2.x > at.x + reach_x) {
      continue;
    }
    if (!made) {
      box.SetAsBox(to_units(half_length_m), to_units(half_height_m));
      box.m_radius = to_units(margin_m);
      made = true;
    }
    b2Manifold manifold;
    manifold.pointCount = 0;
    b2CollideEdgeAndPolygon(&manifold, &edge.shape, still, &box, placed);
    for (int i = 0; i < manifold.pointCount; ++i) {
      const b2Vec2 local = manifold.points[i].localPoint;
      if (manifold.type == b2Manifold::e_faceA) {
        const b2Vec2 corner = b2Mul(placed, local), out = manifold.localNormal;
        const auto point_on_part = [&](double across_m, const Vec3&) { return on_box(local, across_m); };
        add_contacts(plane, ground->across(2), edge, corner - b2Dot(corner - edge.shape.m_vertex1, out) * out,
                     plane.normal(out, 0), margin_m, point_on_part, contact, contacts);
      } else {
        // A face of the belly meets a vertex of the outline.
        const b2Vec2 out = manifold.localNormal;
        const Vec3 normal = -static_cast<double>(out.x) * forward - static_cast<double>(out.y) * up;
        const auto point_on_part = [&](double across_m, const Vec3& ground_m) {
          return ground_m + dot(normal, on_box(manifold.localPoint, across_m) - ground_m) * normal;
        };
        add_contacts(plane, ground->across(2), edge, local, normal, margin_m, point_on_part, contact, contacts);
      }
    }
  }
}

}  // namespace foldcar
