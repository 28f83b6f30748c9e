#include "height_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "elementary_functions.h"

namespace foldcar {
namespace {

constexpr double kMargin_m = 0.3;  // the grid reaches so far beyond the course
constexpr double kError_m = 2e-4;  // allowed in the middle of a cell
constexpr double kSpacings_m[] = {0.02, 0.01, 0.005};
constexpr std::size_t kMostPoints = 4000000;

// Coordinate of the index-th of `count` equidistant points, limits included.
double place_m(double from_m, double to_m, std::size_t index, std::size_t count) {
  return from_m + (to_m - from_m) * static_cast<double>(index) / static_cast<double>(count - 1);
}

// Returns the fields' summed heights at rows × columns equidistant points of a rectangle, row by row; a row has
// constant y.
std::vector<double> sampled(const std::vector<const GroundField*>& fields, double x0_m, double x1_m,
                            std::size_t columns, double y0_m, double y1_m, std::size_t rows) {
  std::vector<double> s_m(columns), line_m(columns), z_m;
  for (std::size_t column = 0; column < columns; ++column) s_m[column] = place_m(0, x1_m - x0_m, column, columns);
  z_m.reserve(rows * columns);
  for (std::size_t row = 0; row < rows; ++row) {
    std::fill(line_m.begin(), line_m.end(), 0.0);
    const Ray ray{x0_m, place_m(y0_m, y1_m, row, rows), 1, 0};
    for (const GroundField* field : fields) field->add_along(ray, s_m, line_m);
    z_m.insert(z_m.end(), line_m.begin(), line_m.end());
  }
  return z_m;
}

// Number of points, at least 3, that divide a length into pieces of at most spacing_m.
std::size_t count(double from_m, double to_m, double spacing_m) {
  return std::max<std::size_t>(3, static_cast<std::size_t>(std::ceil((to_m - from_m) / spacing_m)) + 1);
}

// The largest difference between the ground and the mean of a cell's corners, in the cells' middles.
double error_m(const HeightGrid& grid, const std::vector<const GroundField*>& fields) {
  const double half_x = 0.5 * (grid.x_max_m - grid.x_min_m) / static_cast<double>(grid.columns - 1);
  const double half_y = 0.5 * (grid.y_max_m - grid.y_min_m) / static_cast<double>(grid.rows - 1);
  const std::vector<double> middle = sampled(fields, grid.x_min_m + half_x, grid.x_max_m - half_x, grid.columns - 1,
                                             grid.y_min_m + half_y, grid.y_max_m - half_y, grid.rows - 1);
  double worst_m = 0;
  for (std::size_t row = 0; row + 1 < grid.rows; ++row) {
    for (std::size_t column = 0; column + 1 < grid.columns; ++column) {
      const double* corner = &grid.z_m[row * grid.columns + column];
      const double mean = 0.25 * (corner[0] + corner[1] + corner[grid.columns] + corner[grid.columns + 1]);
      worst_m = std::max(worst_m, std::abs(middle[row * (grid.columns - 1) + column] - mean));
    }
  }
  return worst_m;
}

}  // namespace

// Samples the rectangle around all fields, cut to the course and its margin, at finer spacings until the error is
// allowed.
HeightGrid height_grid(const Ground& ground, const CourseSpec& course) {
  std::vector<const GroundField*> fields;
  const double reach_m = hypotenuse(course.x_max_m - course.x_min_m, course.y_max_m - course.y_min_m) + kMargin_m;
  ground.find({0.5 * (course.x_min_m + course.x_max_m), 0.5 * (course.y_min_m + course.y_max_m), reach_m}, fields);
  HeightGrid grid;
  const double far_m = std::numeric_limits<double>::infinity();
  grid.x_min_m = grid.y_min_m = far_m;
  grid.x_max_m = grid.y_max_m = -far_m;
  for (const GroundField* field : fields) {
    const Disc disc = field->reach();
    grid.x_min_m = std::min(grid.x_min_m, disc.x_m - disc.radius_m);
    grid.x_max_m = std::max(grid.x_max_m, disc.x_m + disc.radius_m);
    grid.y_min_m = std::min(grid.y_min_m, disc.y_m - disc.radius_m);
    grid.y_max_m = std::max(grid.y_max_m, disc.y_m + disc.radius_m);
  }
  grid.x_min_m = std::max(grid.x_min_m, course.x_min_m - kMargin_m);
  grid.x_max_m = std::min(grid.x_max_m, course.x_max_m + kMargin_m);
  grid.y_min_m = std::max(grid.y_min_m, course.y_min_m - kMargin_m);
  grid.y_max_m = std::min(grid.y_max_m, course.y_max_m + kMargin_m);
  if (!(grid.x_min_m < grid.x_max_m && grid.y_min_m < grid.y_max_m)) return HeightGrid{};
  for (const double spacing_m : kSpacings_m) {
    const std::size_t columns = count(grid.x_min_m, grid.x_max_m, spacing_m);
    const std::size_t rows = count(grid.y_min_m, grid.y_max_m, spacing_m);
    if (rows * columns > kMostPoints) {
      if (!grid.z_m.empty()) break;
      throw std::runtime_error("terrain: " + std::to_string(rows) + " x " + std::to_string(columns) +
                               " heights are above the limit " + std::to_string(kMostPoints));
    }
    grid.columns = columns;
    grid.rows = rows;
    grid.z_m = sampled(fields, grid.x_min_m, grid.x_max_m, columns, grid.y_min_m, grid.y_max_m, rows);
    if (error_m(grid, fields) <= kError_m) break;
  }
  return grid;
}

}  // namespace foldcar
