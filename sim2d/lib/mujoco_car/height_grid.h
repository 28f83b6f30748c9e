// The smooth ground as a grid of heights, which is how MuJoCo takes it.
#pragma once

#include <cstddef>
#include <vector>

#include "ground.h"
#include "scene_spec.h"

namespace foldcar {

// Heights at equidistant points of a rectangle, limits included; rows along x, the first one at the least y.
struct HeightGrid {
  double x_min_m = 0, x_max_m = 0, y_min_m = 0, y_max_m = 0;
  std::size_t rows = 0, columns = 0;
  std::vector<double> z_m;
};

// The coarsest grid of 20, 10 or 5 mm whose error in the middles of its cells is within 0.2 mm, else the finest. It
// ends where the ground is level, or a car's length beyond the course. Throws std::runtime_error above 4 million
// points.
HeightGrid height_grid(const Ground& ground, const CourseSpec& course);

}  // namespace foldcar
