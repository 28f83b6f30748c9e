#include "belly_contacts.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace foldcar {
namespace {

// A later kind of separating direction must be better by this much: contacts do not change between kinds of equal
// depth.
constexpr double kPreferred_m = 0.0005;

// Half the length of the belly's box along a unit direction.
double extent_m(const Belly& belly, const Vec3& direction) {
  double sum = 0;
  for (int i = 0; i < 3; ++i) sum += belly.half_m[i] * std::abs(dot(belly.axes[i], direction));
  return sum;
}

// Cuts off the part of a convex polygon that lies on the outward side of the plane through `point`.
void clip(std::vector<Vec3>& polygon, const Vec3& point, const Vec3& outward, std::vector<Vec3>& scratch) {
  scratch.clear();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double a_m = dot(outward, a - point), b_m = dot(outward, b - point);
    if (a_m <= 0) scratch.push_back(a);
    if ((a_m <= 0) != (b_m <= 0)) scratch.push_back(a + (a_m / (a_m - b_m)) * (b - a));
  }
  polygon.swap(scratch);
}

// Direction of the largest separation (smallest penetration, out_m < 0) of belly and solid, and what it belongs to: a
// face of the solid, a face of the belly, or an edge of each.
struct Meeting {
  double out_m = -std::numeric_limits<double>::infinity();
  const Solid::Face* face = nullptr;  // of the solid, or
  int axis = -1;                      // of the belly, on side `side`, or
  double side = 0;
  int edge = -1;  // of the solid, across the belly's axis
  Vec3 normal;    // into the belly
};

// Finds the direction of the largest separation of belly and solid, by the separating axis theorem: for two convex
// bodies it is a face's normal of either or at right angles to an edge of each. False if they are over margin_m apart.
bool find_meeting(const Belly& belly, const Solid& solid, double margin_m, Meeting& best) {
  for (const Solid::Face& face : solid.faces) {
    const double out_m = dot(face.normal, belly.middle - face.corners[0]) - extent_m(belly, face.normal);
    if (out_m > margin_m) return false;
    if (out_m > best.out_m) best = {out_m, &face, -1, 0, -1, face.normal};
  }
  const auto nearest_corner = [&](const Vec3& towards) {
    double least = std::numeric_limits<double>::infinity();
    for (const Vec3& corner : solid.corners) least = std::min(least, dot(towards, corner - belly.middle));
    return least;
  };
  for (int i = 0; i < 3; ++i) {
    for (const double side : {-1.0, 1.0}) {
      const Vec3 outward = side * belly.axes[i];
      const double out_m = nearest_corner(outward) - belly.half_m[i];
      if (out_m > margin_m) return false;
      if (out_m > best.out_m + kPreferred_m) best = {out_m, nullptr, i, side, -1, -1 * outward};
    }
  }
  const Vec3 solid_to_belly = belly.middle - Vec3{solid.reach.x_m, solid.reach.y_m, 0};
  for (int i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < solid.directions.size(); ++j) {
      Vec3 normal = cross(belly.axes[i], solid.directions[j]);
      const double sine2 = dot(normal, normal);
      if (sine2 < 0.01) continue;
      normal = (1 / std::sqrt(sine2)) * normal;
      if (dot(normal, solid_to_belly) < 0) normal = -1 * normal;
      const double out_m = nearest_corner(-1 * normal) - extent_m(belly, normal);
      if (out_m > margin_m) return false;
      if (out_m > best.out_m + kPreferred_m) best = {out_m, nullptr, i, 0, static_cast<int>(j), normal};
    }
  }
  return true;
}

// Returns the belly's corner farthest against the normal. If but_axis is 0 to 2, the middle of the edge along that
// axis.
Vec3 deepest_m(const Belly& belly, const Vec3& normal, int but_axis) {
  Vec3 point = belly.middle;
  for (int i = 0; i < 3; ++i) {
    if (i != but_axis) point = point - std::copysign(belly.half_m[i], dot(belly.axes[i], normal)) * belly.axes[i];
  }
  return point;
}

// Sets `polygon` to the corners of the belly's face at the end of `axis` on `side` (-1 or 1).
void face_of(const Belly& belly, int axis, double side, std::vector<Vec3>& polygon) {
  const int j = (axis + 1) % 3, k = (axis + 2) % 3;
  const Vec3 middle = belly.middle + side * belly.half_m[axis] * belly.axes[axis];
  const Vec3 a = belly.half_m[j] * belly.axes[j], b = belly.half_m[k] * belly.axes[k];
  polygon = {middle + a + b, middle - a + b, middle - a - b, middle + a - b};
}

}  // namespace

// Adds the belly's corners whose height above the ground z = 0 is below margin_m, numbered from 0 in across_m.
void add_level_ground_contacts(const Belly& belly, double margin_m, Contact contact, std::vector<Contact>& contacts) {
  contact.normal = {0, 0, 1};
  if (belly.middle.z - extent_m(belly, contact.normal) > margin_m) return;
  int index = 0;
  for (const double a : {-1.0, 1.0}) {
    for (const double b : {-1.0, 1.0}) {
      for (const double c : {-1.0, 1.0}) {
        contact.point_m = belly.middle + a * belly.half_m[0] * belly.axes[0] + b * belly.half_m[1] * belly.axes[1] +
                          c * belly.half_m[2] * belly.axes[2];
        contact.gap_m = contact.point_m.z;
        contact.across_m = index++;
        if (contact.gap_m < margin_m) contacts.push_back(contact);
      }
    }
  }
}

// Adds the contacts of the belly's box with a convex solid, in the direction of the largest separation. Edge on edge:
// their nearest point. Else the other body's face is clipped to the sides of the separating face, and its corners
// nearer than margin_m are the contacts. across_m numbers contacts (20: edges, from 30 and 50: faces), so that the
// next step knows them.
void add_solid_contacts(const Belly& belly, const Solid& solid, double margin_m, Contact contact,
                        std::vector<Contact>& contacts) {
  Meeting meeting;
  if (!find_meeting(belly, solid, margin_m, meeting)) return;
  contact.normal = meeting.normal;
  if (meeting.edge >= 0) {
    // The belly's edge that is deepest, and the solid's through its deepest corner.
    const Vec3 of_belly = deepest_m(belly, meeting.normal, meeting.axis);
    const Vec3 of_solid = *std::max_element(
        solid.corners.begin(), solid.corners.end(),
        [&](const Vec3& a, const Vec3& b) { return dot(a, meeting.normal) < dot(b, meeting.normal); });
    const Vec3 &u = belly.axes[meeting.axis], &v = solid.directions[static_cast<std::size_t>(meeting.edge)];
    const Vec3 between = of_solid - of_belly;
    const double uv = dot(u, v);
    const double along_m = (dot(between, u) - uv * dot(between, v)) / (1 - uv * uv);
    contact.point_m = of_belly + along_m * u;
    contact.gap_m = meeting.out_m;
    contact.across_m = 20;
    contacts.push_back(contact);
    return;
  }
  std::vector<Vec3> polygon, scratch;
  Vec3 plane_point;
  if (meeting.face != nullptr) {
    int axis = 0;
    for (int i = 1; i < 3; ++i) {
      if (std::abs(dot(belly.axes[i], meeting.normal)) > std::abs(dot(belly.axes[axis], meeting.normal))) axis = i;
    }
    face_of(belly, axis, dot(belly.axes[axis], meeting.normal) > 0 ? -1 : 1, polygon);
    const std::vector<Vec3>& corners = meeting.face->corners;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      clip(polygon, corners[i], cross(corners[(i + 1) % corners.size()] - corners[i], meeting.normal), scratch);
    }
    plane_point = corners[0];
  } else {
    const Solid::Face* incident = &solid.faces[0];
    for (const Solid::Face& face : solid.faces) {
      if (dot(face.normal, meeting.normal) > dot(incident->normal, meeting.normal)) incident = &face;
    }
    polygon = incident->corners;
    for (int i = 0; i < 3; ++i) {
      if (i == meeting.axis) continue;
      for (const double side : {-1.0, 1.0}) {
        const Vec3 outward = side * belly.axes[i];
        clip(polygon, belly.middle + belly.half_m[i] * outward, outward, scratch);
      }
    }
    plane_point = belly.middle + meeting.side * belly.half_m[meeting.axis] * belly.axes[meeting.axis];
  }
  const std::size_t before = contacts.size();
  int index = meeting.face != nullptr ? 30 : 50;
  for (const Vec3& point : polygon) {
    const double height_m = dot(meeting.normal, point - plane_point);
    contact.gap_m = meeting.face != nullptr ? height_m : -height_m;
    contact.point_m = meeting.face != nullptr ? point : point - height_m * meeting.normal;
    contact.across_m = index++;
    if (contact.gap_m < margin_m) contacts.push_back(contact);
  }
  if (contacts.size() > before) return;
  // The faces do not lie over each other: the belly's farthest corner stands for them.
  contact.point_m = deepest_m(belly, meeting.normal, -1);
  contact.gap_m = meeting.out_m;
  contacts.push_back(contact);
}

}  // namespace foldcar
