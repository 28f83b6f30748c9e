#include "solid.h"

#include <algorithm>
#include <cmath>

#include "elementary_functions.h"

namespace foldcar {
namespace {

// Depth of a block's bottom: no wheel or belly reaches it from above.
constexpr double kSunk_m = 1;
constexpr double kArcError_m = 0.00008;

struct ProfilePoint {
  double along_m, z_m;
};

// Returns the upper surface of a block seen from the side, from its rear to its front edge; an arc as chords.
std::vector<ProfilePoint> profile_of(const BlockSpec& block) {
  const double half_m = 0.5 * block.length_m, height_m = block.height_m;
  switch (block.kind) {
    case BlockSpec::Kind::kBox: break;
    case BlockSpec::Kind::kRamp: return {{-half_m, 0}, {half_m, height_m}};
    case BlockSpec::Kind::kHalfRound: {
      const double radius_m = arc_radius_m(block);
      const double half_rad = arc_sine(std::min(1.0, half_m / radius_m));
      const int chords = static_cast<int>(std::ceil(2 * half_rad / std::sqrt(8 * kArcError_m / radius_m)));
      std::vector<ProfilePoint> arc{{-half_m, 0}};
      for (int i = 1; i < chords; ++i) {
        const double angle_rad = half_rad * (2.0 * i / chords - 1);
        arc.push_back({radius_m * sine(angle_rad), height_m - radius_m * (1 - cosine(angle_rad))});
      }
      arc.push_back({half_m, 0});
      return arc;
    }
  }
  return {{-half_m, height_m}, {half_m, height_m}};
}

}  // namespace

// Makes the convex solid of a block: its outline seen from the side, extruded across its width. An edge is listed with
// the normals of the faces that it joins; `directions` holds one unit vector for each set of parallel edges.
Solid make_solid(const BlockSpec& block) {
  std::vector<ProfilePoint> outline = profile_of(block);
  Solid solid;
  solid.reach = {block.x_m, block.y_m, 0.5 * hypotenuse(block.length_m, block.width_m)};
  solid.top_m = block.height_m;
  outline.push_back({0.5 * block.length_m, -kSunk_m});
  outline.push_back({-0.5 * block.length_m, -kSunk_m});
  const auto [s, c] = sine_and_cosine(block.heading_rad);
  const std::size_t count = outline.size();
  Solid::Face right{{s, -c, 0}, {}}, left{{-s, c, 0}, {}};
  for (const ProfilePoint& point : outline) {
    for (Solid::Face* side : {&right, &left}) {
      const Vec3 across = 0.5 * block.width_m * side->normal;
      side->corners.push_back(
          {block.x_m + c * point.along_m + across.x, block.y_m + s * point.along_m + across.y, point.z_m});
    }
  }
  const Vec3 axis{-s, c, 0};
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t j = (i + 1) % count;
    const Vec3 edge = right.corners[j] - right.corners[i];
    solid.faces.push_back(
        {unit(cross(edge, axis)), {right.corners[i], right.corners[j], left.corners[j], left.corners[i]}});
    if (i + 3 < count) solid.directions.push_back(unit(edge));
  }
  solid.directions.push_back(axis);
  solid.directions.push_back({0, 0, 1});
  // The lowest corners are the last two.
  for (std::size_t i = 0; i + 2 < count; ++i) {
    const Vec3 before = solid.faces[(i + count - 1) % count].normal, after = solid.faces[i].normal;
    solid.edges.push_back({right.corners[i], left.corners[i], {before, after}});
    for (const Solid::Face* side : {&right, &left}) {
      if (i == 0) solid.edges.push_back({side->corners[count - 1], side->corners[0], {before, side->normal}});
      solid.edges.push_back({side->corners[i], side->corners[i + 1], {after, side->normal}});
      solid.tops.push_back({side->corners[i], {before, after, side->normal}});
    }
  }
  for (Solid::Face* side : {&right, &left}) {
    solid.corners.insert(solid.corners.end(), side->corners.begin(), side->corners.end());
  }
  // Seen from outside the outline runs clockwise on the right side.
  std::reverse(right.corners.begin(), right.corners.end());
  solid.faces.push_back(right);
  solid.faces.push_back(left);
  return solid;
}

}  // namespace foldcar
