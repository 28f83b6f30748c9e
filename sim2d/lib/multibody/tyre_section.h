// The section of a block by the plane of a disc across a tyre, and what the disc's circle meets of it.
#pragma once

#include <limits>

#include "solid.h"
#include "vec3.h"

namespace foldcar {

struct Tyre {
  Vec3 centre, axis;  // axis to the car's left
  double radius_m, half_width_m;
  double reach_m() const { return radius_m + half_width_m; }
};

// The part of a line within the tyre's circle, as shares of its length; false if there is none. a, b and c are those of
// a s² + 2 b s + c = 0 at the circle.
bool within_circle(double a, double b, double c, double& first, double& last);

// The straight line along which the plane of a disc cuts a face.
struct Cut {
  Vec3 from_m, to_m;
  Vec3 from_edge, to_edge;  // along the edges of the face that its ends lie on
};

// False if the plane through centre across axis does not cut the face.
bool cut_face(const Solid::Face& face, const Vec3& centre, const Vec3& axis, Cut& cut);

// A disc across the tyre and what it meets in its own plane.
struct CrossDisc {
  Vec3 centre;
  double across_m = 0;
  double gap_m = std::numeric_limits<double>::infinity();
  Vec3 normal;   // into the tyre
  Vec3 point_m;  // of the tyre
};

// The nearest point of the solid's section with the disc's plane; within it, the face that is left the soonest. Where
// that is a face, the normal is the face's; where it is an edge, the normal is across the edge and the tyre's rim. The
// gap stays infinite where it is larger than margin_m.
void meet_in_plane(const Tyre& tyre, const Solid& solid, double margin_m, CrossDisc& disc);

}  // namespace foldcar
