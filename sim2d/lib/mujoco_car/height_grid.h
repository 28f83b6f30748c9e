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

// Samples the ground's heights, at the coarsest spacing of 20, 10 or 5 mm whose error in the middles of the cells is
// within 0.2 mm, else at the finest with up to 4 million points. The grid ends where the ground is level, at most 0.3
// m beyond the course; it is empty if all of the ground there is level. Throws std::runtime_error if even 20 mm take
// more points.
HeightGrid height_grid(const Ground& ground, const CourseSpec& course);

}  // namespace foldcar
