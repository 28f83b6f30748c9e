#include "tyre_contacts.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace foldcar {
namespace {

// A face whose normal is closer to the axle's direction than the angle of this cosine is a wall beside the tyre.
constexpr double kWall = 0.7;
// Lateral coordinate that tells a wall's contacts from those under the tyre.
constexpr double kAside_m = 1;

double distance_m(const Solid::Face& face, const Vec3& point_m) { return dot(face.normal, point_m - face.corners[0]); }

// Whether the point lies in the convex solid, without testing face `but`.
bool within(const Solid& solid, const Vec3& point_m, const Solid::Face& but) {
  return std::all_of(solid.faces.begin(), solid.faces.end(), [&](const Solid::Face& face) {
    return &face == &but || distance_m(face, point_m) <= 0;
  });
}

// Calls visit with points that disc and solid have in common, among which is the deepest one below the contact face: the
// disc's own deepest point if it lies in the solid, and the ends, within the circle, of the cuts of the other faces
// through the disc.
template <typename Visit>
void for_each_overlap(const Tyre& tyre, const CrossDisc& disc, const Solid& solid, const Solid::Face& contact_face,
                      const Visit& visit) {
  const Vec3 in_plane = dot(contact_face.normal, tyre.axis) * tyre.axis - contact_face.normal;
  if (dot(in_plane, in_plane) > 1e-12) {
    const Vec3 extreme = disc.centre + tyre.radius_m * unit(in_plane);
    if (within(solid, extreme, contact_face)) visit(extreme);
  }
  for (const Solid::Face& face : solid.faces) {
    Cut cut;
    if (&face == &contact_face || !cut_face(face, disc.centre, tyre.axis, cut)) continue;
    const Vec3 line = cut.to_m - cut.from_m, from = cut.from_m - disc.centre;
    double first, last;
    if (!within_circle(dot(line, line), dot(line, from), dot(from, from) - tyre.radius_m * tyre.radius_m, first, last)) {
      continue;
    }
    visit(cut.from_m + first * line);
    visit(cut.from_m + last * line);
  }
}

// Whether a direction lies between the normals of an edge's faces.
bool between(const Vec3& direction, const Vec3 (&normals)[2]) {
  const double a = dot(direction, normals[0]), b = dot(direction, normals[1]), c = dot(normals[0], normals[1]);
  return a >= b * c && b >= a * c;
}

// Calls visit with every edge and corner that the tread meets between its rims: a disc there with its gap, normal and
// point.
template <typename Visit>
void for_each_edge_under(const Tyre& tyre, const Solid& solid, double margin_m, const Visit& visit) {
  const auto meet = [&](double across_m, const Vec3& away) {
    const double away_m = std::sqrt(dot(away, away));
    if (away_m > tyre.radius_m + margin_m || away_m == 0) return;
    CrossDisc disc;
    disc.centre = tyre.centre + across_m * tyre.axis;
    disc.across_m = across_m;
    disc.gap_m = away_m - tyre.radius_m;
    disc.normal = (1 / away_m) * away;
    disc.point_m = disc.centre - tyre.radius_m * disc.normal;
    visit(disc);
  };
  for (const Solid::Edge& edge : solid.edges) {
    const Vec3 line = edge.to_m - edge.from_m, from = edge.from_m - tyre.centre;
    const double line_a = dot(line, tyre.axis), from_a = dot(from, tyre.axis);
    const double a = dot(line, line) - line_a * line_a;
    if (a < 1e-6 * dot(line, line)) continue;
    const double share = (line_a * from_a - dot(line, from)) / a;
    if (share < 0 || share > 1) continue;
    const double across_m = from_a + share * line_a;
    if (std::abs(across_m) >= tyre.half_width_m) continue;
    const Vec3 away = across_m * tyre.axis - (from + share * line);
    if (between(away, edge.normals)) meet(across_m, away);
  }
  for (const Solid::Corner& corner : solid.tops) {
    const Vec3 from = corner.at_m - tyre.centre;
    const double across_m = dot(from, tyre.axis);
    if (std::abs(across_m) >= tyre.half_width_m) continue;
    const Vec3 away = across_m * tyre.axis - from;
    if (std::all_of(std::begin(corner.normals), std::end(corner.normals),
                    [&](const Vec3& normal) { return dot(away, normal) >= 0; })) {
      meet(across_m, away);
    }
  }
}

// Calls visit with the ends of the parts of the solid's edges that lie within the tyre's circle.
template <typename Visit>
void for_each_edge_within(const Tyre& tyre, const Solid& solid, const Visit& visit) {
  for (const Solid::Edge& edge : solid.edges) {
    const Vec3 line = edge.to_m - edge.from_m, from = edge.from_m - tyre.centre;
    const double line_a = dot(line, tyre.axis), from_a = dot(from, tyre.axis);
    double first, last;
    if (!within_circle(dot(line, line) - line_a * line_a, dot(line, from) - line_a * from_a,
                       dot(from, from) - from_a * from_a - tyre.radius_m * tyre.radius_m, first, last)) {
      continue;
    }
    visit(edge.from_m + first * line);
    visit(edge.from_m + last * line);
  }
}

// Appends the contacts that push a tyre sideways out of a solid which one of its two discs overlaps: off a wall of the
// solid, or off edges that press into the tyre's side. free_side is the side of the other disc. Returns false, without
// contacts, if the way out is not shorter than limit_m.
bool add_sideways_contacts(const Tyre& tyre, const CrossDisc& disc, double free_side, const Solid& solid,
                           double limit_m, Contact contact, std::vector<Contact>& contacts) {
  const Solid::Face* wall = nullptr;
  for (const Solid::Face& face : solid.faces) {
    if (dot(face.normal, tyre.axis) * free_side < kWall) continue;
    double deepest_m = 0;
    for_each_overlap(tyre, disc, solid, face,
                     [&](const Vec3& point_m) { deepest_m = std::max(deepest_m, -distance_m(face, point_m)); });
    if (deepest_m > 0 && deepest_m < limit_m) {
      limit_m = deepest_m;
      wall = &face;
    }
  }
  const Vec3 out = free_side * tyre.axis;
  const auto depth_m = [&](const Vec3& point_m) { return dot(out, point_m - disc.centre); };
  double edge_m = 0;
  for_each_edge_within(tyre, solid, [&](const Vec3& point_m) { edge_m = std::max(edge_m, depth_m(point_m)); });
  const bool edges = edge_m > 0 && edge_m < limit_m;
  if (wall == nullptr && !edges) return false;
  contact.across_m = kAside_m;
  const auto add = [&](const Vec3& point_m, double gap_m) {
    contact.point_m = point_m;
    contact.gap_m = gap_m;
    contact.across_m += 1;
    if (gap_m < -0.5 * limit_m) contacts.push_back(contact);
  };
  if (edges) {
    limit_m = edge_m;
    contact.normal = out;
    for_each_edge_within(tyre, solid, [&](const Vec3& point_m) { add(point_m, -depth_m(point_m)); });
  } else {
    contact.normal = wall->normal;
    for_each_overlap(tyre, disc, solid, *wall, [&](const Vec3& point_m) { add(point_m, distance_m(*wall, point_m)); });
  }
  return true;
}

}  // namespace

// Adds the contacts of a tyre, a cylinder, with the ground z = 0: the lowest point of each rim, if its gap is <
// margin_m.
void add_level_ground_contacts(const Tyre& tyre, double margin_m, Contact contact, std::vector<Contact>& contacts) {
  if (tyre.centre.z > tyre.radius_m + tyre.half_width_m + margin_m) return;
  contact.normal = {0, 0, 1};
  const Vec3 down = unit(tyre.axis.z * tyre.axis - contact.normal);
  for (const double side : {-1.0, 1.0}) {
    contact.across_m = side * tyre.half_width_m;
    contact.point_m = tyre.centre + contact.across_m * tyre.axis + tyre.radius_m * down;
    contact.gap_m = contact.point_m.z;
    if (contact.gap_m < margin_m) contacts.push_back(contact);
  }
}

// Adds the contacts of a tyre with a convex solid: of the discs at its two rims, and of edges and corners under its
// tread. If only one rim's disc overlaps and the way out sideways is shorter, contacts that push it sideways instead.
void add_solid_contacts(const Tyre& tyre, const Solid& solid, double margin_m, Contact contact,
                        std::vector<Contact>& contacts) {
  const auto disc_at = [&](double across_m) {
    CrossDisc disc;
    disc.centre = tyre.centre + across_m * tyre.axis;
    disc.across_m = across_m;
    meet_in_plane(tyre, solid, margin_m, disc);
    return disc;
  };
  const auto add = [&](const CrossDisc& disc) {
    if (disc.gap_m >= margin_m) return;
    contact.normal = disc.normal;
    contact.point_m = disc.point_m;
    contact.gap_m = disc.gap_m;
    contact.across_m = disc.across_m;
    contacts.push_back(contact);
  };
  const CrossDisc right = disc_at(-tyre.half_width_m), left = disc_at(tyre.half_width_m);
  const bool right_in = right.gap_m < 0, left_in = left.gap_m < 0;
  if (right_in != left_in) {
    const CrossDisc& in = right_in ? right : left;
    double depth_m = -in.gap_m;
    for_each_edge_under(tyre, solid, margin_m, [&](const CrossDisc& disc) { depth_m = std::max(depth_m, -disc.gap_m); });
    if (add_sideways_contacts(tyre, in, right_in ? 1 : -1, solid, depth_m, contact, contacts)) return;
  }
  add(right);
  add(left);
  for_each_edge_under(tyre, solid, margin_m, add);
}

}  // namespace foldcar
