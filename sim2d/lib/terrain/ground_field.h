// A smooth field of heights over the plane; the ground is the sum of such fields.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace foldcar {

// A straight line over the plane; s is counted from its point along its direction.
struct Ray {
  double x_m = 0;
  double y_m = 0;
  double cosine = 1;
  double sine = 0;
};

// A disc of the plane around a point.
struct Disc {
  double x_m = 0;
  double y_m = 0;
  double radius_m = 0;
};

// Whether two discs have points in common.
inline bool overlap(const Disc& a, const Disc& b) {
  const double dx = a.x_m - b.x_m, dy = a.y_m - b.y_m, reach = a.radius_m + b.radius_m;
  return dx * dx + dy * dy < reach * reach;
}

// One field of heights; lengths in metres.
class GroundField {
 public:
  virtual ~GroundField() = default;
  // A disc outside which the field is 0.
  virtual Disc reach() const = 0;
  // Height at a point of the world.
  virtual double height_m(double x_m, double y_m) const = 0;
  // Adds the heights at the stations (ascending) of the ray to z_m.
  virtual void add_along(const Ray& ray, const std::vector<double>& s_m, std::vector<double>& z_m) const = 0;
  // An upper bound (1/m) of the magnitude of the second derivative along any line inside the disc; 0 where the field is
  // 0.
  virtual double curvature_1_m(const Disc& disc) const = 0;
};

// Stations [first, last) of the ray at which a·s² + b·s + c < limit; a > 0.
inline void inside(double a, double b, double c, double limit, const std::vector<double>& s_m, std::size_t& first,
                   std::size_t& last) {
  first = last = 0;
  const double discriminant = b * b - 4 * a * (c - limit);
  if (discriminant <= 0) return;
  const double root = std::sqrt(discriminant);
  const auto from = std::lower_bound(s_m.begin(), s_m.end(), (-b - root) / (2 * a));
  first = static_cast<std::size_t>(from - s_m.begin());
  last = static_cast<std::size_t>(std::lower_bound(from, s_m.end(), (-b + root) / (2 * a)) - s_m.begin());
}

}  // namespace foldcar
