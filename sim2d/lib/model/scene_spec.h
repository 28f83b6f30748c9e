// An environment as the simulator takes it: what docs/carsim.md calls a scene, in SI units.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "program_spec.h"

namespace foldcar {

// Blocks stand on z = 0: length along the heading, width across, height to the highest point.
struct BlockSpec {
  enum class Kind {
    kBox,
    kRamp,       // rises evenly from 0 at its rear edge, then drops
    kHalfRound,  // a circular arc along the heading
  };
  double x_m = 0;
  double y_m = 0;
  double length_m = 0;
  double width_m = 0;
  double height_m = 0;
  double heading_rad = 0;
  Kind kind = Kind::kBox;
};

// Radius of a half-round's arc.
inline double arc_radius_m(const BlockSpec& block) {
  return (0.25 * block.length_m * block.length_m + block.height_m * block.height_m) / (2 * block.height_m);
}

// Gaussian, cut off at 4 standard deviations; a negative height is a hollow.
struct HillSpec {
  double x_m = 0;
  double y_m = 0;
  double heading_rad = 0;
  double sd_along_m = 0;
  double sd_across_m = 0;
  double height_m = 0;
};

// A round hole with a flat bottom, whose wall slopes smoothly over the last edge_m of its radius.
struct PotholeSpec {
  double x_m = 0;
  double y_m = 0;
  double radius_m = 0;
  double depth_m = 0;
  double edge_m = 0;
};

// Random heights in a rectangle, see terrain/rough.h.
struct RoughSpec {
  double x_m = 0;
  double y_m = 0;
  double heading_rad = 0;
  double length_m = 0;
  double width_m = 0;
  double height_sd_m = 0;
  double correlation_m = 0;
  int seed = 0;
};

// A rectangle of ground with its own friction.
struct PatchSpec {
  double x_m = 0;
  double y_m = 0;
  double heading_rad = 0;
  double length_m = 0;
  double width_m = 0;
  double friction = 0;
};

// Hills, potholes and rough ground add up to the ground; the highest of it and of the blocks counts. Of patches
// the last one counts.
struct TerrainSpec {
  std::vector<BlockSpec> blocks;
  std::vector<HillSpec> hills;
  std::vector<PotholeSpec> potholes;
  std::vector<RoughSpec> roughs;
  std::vector<PatchSpec> patches;
};

// A position and heading in the ground plane.
struct PoseSpec {
  double x_m = 0;
  double y_m = 0;
  double heading_rad = 0;
};

// A line through the point, crossed along heading_rad, or a disc around it.
struct GoalSpec {
  enum class Kind { kLine, kDisc };
  Kind kind = Kind::kLine;
  double x_m = 0;
  double y_m = 0;
  double heading_rad = 0;
  double radius_m = 0;
};

// Leaving this rectangle ends a run.
struct CourseSpec {
  double x_min_m = 0;
  double x_max_m = 0;
  double y_min_m = 0;
  double y_max_m = 0;
};

// A whole scene; friction is a coefficient.
struct SceneSpec {
  std::string id;
  double friction = 0;  // outside patches
  TerrainSpec terrain;
  PoseSpec start;
  std::optional<GoalSpec> goal;
  CourseSpec course;
  ProgramSpec program;
};

}  // namespace foldcar
