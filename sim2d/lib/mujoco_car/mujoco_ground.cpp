#include "mujoco_ground.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "elementary_functions.h"
#include "height_grid.h"
#include "plain_quaternion.h"

namespace foldcar {
namespace {

constexpr float kFloorColour[] = {0.93F, 0.92F, 0.88F, 1};
constexpr float kPieceColour[] = {0.75F, 0.6F, 0.4F, 1};
constexpr double kSunk_m = 0.1;        // blocks reach so far below the ground
constexpr double kFloorReach_m = 50;   // of the level floor around a height field, from the origin
constexpr double kFloorDepth_m = 1;    // of that floor's boxes
constexpr double kFieldBase_m = 0.2;   // thickness of a height field below its lowest point
// MuJoCo refuses a height field without elevation.
constexpr double kLeastRise_m = 1e-6;

// A geom that collides with the car only.
mjsGeom& ground_geom(mjSpec* spec, mjtGeom type, const std::string& name, const float (&colour)[4]) {
  mjsGeom& geom = *mjs_addGeom(mjs_findBody(spec, "world"), nullptr);
  mjs_setName(geom.element, name.c_str());
  geom.type = type;
  std::copy(std::begin(colour), std::end(colour), geom.rgba);
  geom.contype = 1;
  geom.conaffinity = 2;
  return geom;
}

void add_box(mjSpec* spec, const BlockSpec& block, const std::string& name) {
  mjsGeom& box = ground_geom(spec, mjGEOM_BOX, name, kPieceColour);
  set_vector(box.size, 0.5 * block.length_m, 0.5 * block.width_m, 0.5 * (block.height_m + kSunk_m));
  set_vector(box.pos, block.x_m, block.y_m, block.height_m - box.size[2]);
  set_heading(box.quat, block.heading_rad);
}

// Adds a ramp as a mesh: the convex hull of its corners, from height 0 at the back to height_m at the front.
void add_ramp(mjSpec* spec, const BlockSpec& ramp, const std::string& name) {
  std::vector<float> corners;
  for (const double side : {-1.0, 1.0}) {
    const double y_m = 0.5 * side * ramp.width_m, front_m = 0.5 * ramp.length_m;
    for (const double x_m : {-front_m, front_m}) {
      for (const double z_m : {-kSunk_m, x_m < 0 ? 0.0 : ramp.height_m}) {
        for (const double value : {x_m, y_m, z_m}) corners.push_back(static_cast<float>(value));
      }
    }
  }
  mjsMesh& mesh = *mjs_addMesh(spec, nullptr);
  mjs_setName(mesh.element, name.c_str());
  mjs_setFloat(mesh.uservert, corners.data(), static_cast<int>(corners.size()));
  mjsGeom& geom = ground_geom(spec, mjGEOM_MESH, name, kPieceColour);
  mjs_setString(geom.meshname, name.c_str());
  set_vector(geom.pos, ramp.x_m, ramp.y_m, 0);
  set_heading(geom.quat, ramp.heading_rad);
}

// Adds a round hump: a cylinder that lies across, whose top is at the block's height.
void add_half_round(mjSpec* spec, const BlockSpec& block, const std::string& name) {
  const double radius_m = arc_radius_m(block);
  mjsGeom& geom = ground_geom(spec, mjGEOM_CYLINDER, name, kPieceColour);
  set_vector(geom.size, radius_m, 0.5 * block.width_m, 0);
  set_vector(geom.pos, block.x_m, block.y_m, block.height_m - radius_m);
  // A quarter turn about x lays the cylinder across; then the heading.
  const double half_rad = 0.5 * block.heading_rad, r = std::sqrt(0.5);
  set_quaternion(geom.quat, r * cosine(half_rad), r * cosine(half_rad), r * sine(half_rad),
                 r * sine(half_rad));
}

// Adds the smooth ground as a height field (heights as fractions of its rise) and, around it, a level floor of four
// boxes.
void add_height_field(mjSpec* spec, const HeightGrid& grid) {
  const auto [low, high] = std::minmax_element(grid.z_m.begin(), grid.z_m.end());
  const double low_m = *low, rise_m = std::max(*high - *low, kLeastRise_m);
  const double half_x_m = 0.5 * (grid.x_max_m - grid.x_min_m), half_y_m = 0.5 * (grid.y_max_m - grid.y_min_m);
  const double x_m = 0.5 * (grid.x_max_m + grid.x_min_m), y_m = 0.5 * (grid.y_max_m + grid.y_min_m);
  std::vector<float> rise(grid.z_m.size());
  for (std::size_t i = 0; i < rise.size(); ++i) rise[i] = static_cast<float>((grid.z_m[i] - low_m) / rise_m);
  mjsHField& field = *mjs_addHField(spec);
  mjs_setName(field.element, "ground");
  field.nrow = static_cast<int>(grid.rows);
  field.ncol = static_cast<int>(grid.columns);
  field.size[0] = half_x_m;
  field.size[1] = half_y_m;
  field.size[2] = rise_m;
  field.size[3] = kFieldBase_m;
  mjs_setFloat(field.userdata, rise.data(), static_cast<int>(rise.size()));
  mjsGeom& geom = ground_geom(spec, mjGEOM_HFIELD, "ground", kFloorColour);
  mjs_setString(geom.hfieldname, "ground");
  set_vector(geom.pos, x_m, y_m, low_m);
  const double far_m = kFloorReach_m;
  const struct { const char* name; double x0, x1, y0, y1; } around[] = {
      {"floor_back", -far_m, grid.x_min_m, -far_m, far_m},
      {"floor_front", grid.x_max_m, far_m, -far_m, far_m},
      {"floor_right", grid.x_min_m, grid.x_max_m, -far_m, grid.y_min_m},
      {"floor_left", grid.x_min_m, grid.x_max_m, grid.y_max_m, far_m},
  };
  for (const auto& floor : around) {
    mjsGeom& box = ground_geom(spec, mjGEOM_BOX, floor.name, kFloorColour);
    set_vector(box.size, 0.5 * (floor.x1 - floor.x0), 0.5 * (floor.y1 - floor.y0), 0.5 * kFloorDepth_m);
    set_vector(box.pos, 0.5 * (floor.x0 + floor.x1), 0.5 * (floor.y0 + floor.y1), -0.5 * kFloorDepth_m);
  }
}

}  // namespace

void add_mujoco_ground(mjSpec* spec, const SceneSpec& scene, const Terrain& terrain) {
  const HeightGrid grid = terrain.ground() == nullptr ? HeightGrid{} : height_grid(*terrain.ground(), scene.course);
  if (grid.z_m.empty()) {
    set_vector(ground_geom(spec, mjGEOM_PLANE, "floor", kFloorColour).size, 0, 0, 1);
  } else {
    add_height_field(spec, grid);
  }
  int count = 0;
  for (const BlockSpec& block : scene.terrain.blocks) {
    const std::string number = std::to_string(count++);
    switch (block.kind) {
      case BlockSpec::Kind::kBox: add_box(spec, block, "box" + number); break;
      case BlockSpec::Kind::kRamp: add_ramp(spec, block, "ramp" + number); break;
      case BlockSpec::Kind::kHalfRound: add_half_round(spec, block, "half_round" + number); break;
    }
  }
}

}  // namespace foldcar
