// A block as a convex polyhedron in the world, sunk into the ground below z = 0.
#pragma once

#include <vector>

#include "ground_field.h"
#include "scene_spec.h"
#include "vec3.h"

namespace foldcar {

struct Solid {
  // A face with its outer normal; the corners run counter-clockwise seen from outside.
  struct Face {
    Vec3 normal;
    std::vector<Vec3> corners;
  };
  // Between two faces.
  struct Edge {
    Vec3 from_m, to_m;
    Vec3 normals[2];
  };
  // An upper corner, between three faces.
  struct Corner {
    Vec3 at_m;
    Vec3 normals[3];
  };
  Disc reach;      // of its plan
  double top_m;    // its highest point
  std::vector<Vec3> corners;
  std::vector<Face> faces;
  std::vector<Edge> edges;  // but the lowest
  std::vector<Vec3> directions;  // of the edges
  std::vector<Corner> tops;
};

// Boxes and ramps are exact; a half-round is a prism on chords at most 0.1 mm below its arc.
Solid make_solid(const BlockSpec& block);

}  // namespace foldcar
