#include "pothole.h"

#include "elementary_functions.h"

namespace foldcar {
namespace {

// Depth at a distance r_m from the middle: the whole depth inside, 0 outside, a smooth step t²(3 - 2t) over edge_m.
double depth_at(const PotholeSpec& spec, double r_m) {
  const double t = std::clamp((spec.radius_m - r_m) / spec.edge_m, 0.0, 1.0);
  return spec.depth_m * t * t * (3 - 2 * t);
}

}  // namespace

double Pothole::height_m(double x_m, double y_m) const {
  return -depth_at(spec_, hypotenuse(x_m - spec_.x_m, y_m - spec_.y_m));
}

void Pothole::add_along(const Ray& ray, const std::vector<double>& s_m, std::vector<double>& z_m) const {
  const double dx = ray.x_m - spec_.x_m, dy = ray.y_m - spec_.y_m;
  const double b = 2 * (dx * ray.cosine + dy * ray.sine), c = dx * dx + dy * dy;
  std::size_t first, last;
  inside(1, b, c, spec_.radius_m * spec_.radius_m, s_m, first, last);
  for (std::size_t i = first; i < last; ++i) {
    z_m[i] -= depth_at(spec_, std::sqrt(std::max(0.0, (s_m[i] + b) * s_m[i] + c)));
  }
}

// Returns an upper bound of the curvature within the disc. Only the wall is curved. The radial second derivative is at
// most 6·depth/edge²; the tangential one, slope over r, is at most the same.
double Pothole::curvature_1_m(const Disc& disc) const {
  const double distance_m = hypotenuse(disc.x_m - spec_.x_m, disc.y_m - spec_.y_m);
  const bool meets_wall = distance_m - disc.radius_m < spec_.radius_m &&
                          distance_m + disc.radius_m > spec_.radius_m - spec_.edge_m;
  return meets_wall ? 6 * spec_.depth_m / (spec_.edge_m * spec_.edge_m) : 0;
}

}  // namespace foldcar
