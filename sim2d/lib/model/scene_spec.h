// An environment as the simulator takes it: what docs/carsim.md calls a scene, in SI units.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace foldcar {

// An upright box on the ground: length along its heading, width across.
struct BoxSpec {
  double x_m = 0;
  double y_m = 0;
  double length_m = 0;
  double width_m = 0;
  double height_m = 0;
  double heading_rad = 0;
};

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

struct SceneSpec {
  std::string id;
  double friction = 0;
  std::vector<BoxSpec> boxes;
  PoseSpec start;
  std::optional<GoalSpec> goal;
  CourseSpec course;
};

}  // namespace foldcar
