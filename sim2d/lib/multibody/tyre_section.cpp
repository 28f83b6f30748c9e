#include "tyre_section.h"

#include <algorithm>
#include <cmath>

namespace foldcar {

// Finds where a line lies within a circle: the t between 0 and 1 with a t² + 2 b t + c <= 0, from `first` to `last`.
// False if there is no such range.
bool within_circle(double a, double b, double c, double& first, double& last) {
  if (b * b <= a * c) return false;
  const double root = std::sqrt(b * b - a * c);
  first = std::max(0.0, (-b - root) / a);
  last = std::min(1.0, (-b + root) / a);
  return first < last;
}

// Cuts a convex face by the plane through `centre` normal to `axis`: sets the cut's two ends and the face's edges on
// which they lie. False if the plane does not cross the face.
bool cut_face(const Solid::Face& face, const Vec3& centre, const Vec3& axis, Cut& cut) {
  int found = 0;
  Vec3 before = face.corners.back();
  double before_m = dot(axis, before - centre);
  for (const Vec3& corner : face.corners) {
    const double corner_m = dot(axis, corner - centre);
    if ((before_m < 0) != (corner_m < 0)) {
      const Vec3 edge = corner - before;
      (found == 0 ? cut.from_edge : cut.to_edge) = edge;
      (found++ == 0 ? cut.from_m : cut.to_m) = before + (before_m / (before_m - corner_m)) * edge;
    }
    before = corner;
    before_m = corner_m;
  }
  return found == 2;
}

// Sets gap, normal and point of a thin disc of the tyre against a convex solid. In the disc's plane the solid is a
// convex polygon, its faces' cuts: from outside the nearest point of the polygon counts, from inside the nearest line.
// At a corner of the polygon, where an edge of the solid crosses the plane, the normal is at right angles to that
// edge. Leaves `disc` as it is if they are further than margin_m apart or the plane misses the solid.
void meet_in_plane(const Tyre& tyre, const Solid& solid, double margin_m, CrossDisc& disc) {
  // The plane most often misses the solid: then all corners are on one side of it.
  const auto is_behind = [&](const Vec3& corner) { return dot(tyre.axis, corner - disc.centre) < 0; };
  const bool first_is_behind = is_behind(solid.corners[0]);
  if (std::all_of(solid.corners.begin() + 1, solid.corners.end(),
                  [&](const Vec3& corner) { return is_behind(corner) == first_is_behind; })) {
    return;
  }
  double inside_m = -std::numeric_limits<double>::infinity(), nearest_m2 = std::numeric_limits<double>::infinity();
  Vec3 away, normal, edge;  // edge: 0 on a face
  for (const Solid::Face& face : solid.faces) {
    Cut cut;
    if (!cut_face(face, disc.centre, tyre.axis, cut)) continue;
    const Vec3 in_plane = face.normal - dot(face.normal, tyre.axis) * tyre.axis;
    if (dot(in_plane, in_plane) < 1e-12) continue;  // the disc lies in the face
    const Vec3 out = unit(in_plane);
    const double out_m = dot(out, disc.centre - cut.from_m);
    if (out_m > tyre.radius_m + margin_m) return;
    if (out_m <= 0) {
      if (out_m > inside_m && nearest_m2 == std::numeric_limits<double>::infinity()) {
        inside_m = out_m;
        away = out;
        normal = face.normal;
      }
      continue;
    }
    const Vec3 line = cut.to_m - cut.from_m;
    const double share = std::clamp(dot(line, disc.centre - cut.from_m) / dot(line, line), 0.0, 1.0);
    const Vec3 to_centre = disc.centre - (cut.from_m + share * line);
    if (dot(to_centre, to_centre) < nearest_m2) {
      nearest_m2 = dot(to_centre, to_centre);
      away = to_centre;
      normal = face.normal;
      edge = share <= 0 ? cut.from_edge : share >= 1 ? cut.to_edge : Vec3{};
    }
  }
  const bool outside = nearest_m2 < std::numeric_limits<double>::infinity();
  if (!outside && inside_m == -std::numeric_limits<double>::infinity()) return;
  const double away_m = outside ? std::sqrt(nearest_m2) : inside_m;
  if (outside) away = (1 / away_m) * away;
  if (outside && dot(edge, edge) > 0) {
    normal = unit(cross(cross(tyre.axis, away), edge));
    if (dot(normal, away) < 0) normal = -1 * normal;
  }
  disc.normal = normal;
  disc.gap_m = (away_m - tyre.radius_m) * dot(normal, away);
  disc.point_m = disc.centre - tyre.radius_m * away;
}

}  // namespace foldcar
