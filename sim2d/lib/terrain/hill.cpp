#include "hill.h"

#include <array>

#include "elementary_functions.h"

namespace foldcar {
namespace {

constexpr double kCutOff = 4;                         // standard deviations
constexpr double kLimit = 0.5 * kCutOff * kCutOff;    // of the exponent
constexpr std::size_t kIntervals = 2048;
constexpr double kPerUnit = kIntervals / kLimit;

// exp(-u) up to the cut-off, as a table to interpolate in: a few millionths off and a fifth of the time.
const std::array<double, kIntervals + 2>& bell_table() {
  static const std::array<double, kIntervals + 2> table = [] {
    std::array<double, kIntervals + 2> values{};
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = exponential(-static_cast<double>(i) / kPerUnit);
    return values;
  }();
  return table;
}

// exp(-u), interpolated in the table.
double bell(const double* table, double u) {
  const double at = std::max(0.0, u) * kPerUnit;
  const auto i = static_cast<std::size_t>(at);
  return table[i] + (table[i + 1] - table[i]) * (at - static_cast<double>(i));
}

}  // namespace

Hill::Hill(const HillSpec& spec)
    : reach_{spec.x_m, spec.y_m, kCutOff * std::max(spec.sd_along_m, spec.sd_across_m)},
      height_m_(spec.height_m),
      least_sd_m_(std::min(spec.sd_along_m, spec.sd_across_m)),
      ax_(cosine(spec.heading_rad) / spec.sd_along_m),
      ay_(sine(spec.heading_rad) / spec.sd_along_m),
      cx_(-sine(spec.heading_rad) / spec.sd_across_m),
      cy_(cosine(spec.heading_rad) / spec.sd_across_m) {}

double Hill::height_m(double x_m, double y_m) const {
  const double dx = x_m - reach_.x_m, dy = y_m - reach_.y_m;
  const double along = ax_ * dx + ay_ * dy, across = cx_ * dx + cy_ * dy;
  const double u = 0.5 * (along * along + across * across);
  return u < kLimit ? height_m_ * bell(bell_table().data(), u) : 0;
}

// Adds the hill's height at the points s_m of a line to z_m. The exponent along it is a quadratic function a·s² + b·s
// + c.
void Hill::add_along(const Ray& ray, const std::vector<double>& s_m, std::vector<double>& z_m) const {
  const double dx = ray.x_m - reach_.x_m, dy = ray.y_m - reach_.y_m;
  const double along = ax_ * dx + ay_ * dy, along_1_m = ax_ * ray.cosine + ay_ * ray.sine;
  const double across = cx_ * dx + cy_ * dy, across_1_m = cx_ * ray.cosine + cy_ * ray.sine;
  const double a = 0.5 * (along_1_m * along_1_m + across_1_m * across_1_m);
  const double b = along * along_1_m + across * across_1_m;
  const double c = 0.5 * (along * along + across * across);
  std::size_t first, last;
  inside(a, b, c, kLimit, s_m, first, last);
  const double* table = bell_table().data();
  for (std::size_t i = first; i < last; ++i) {
    const double u = std::min((a * s_m[i] + b) * s_m[i] + c, kLimit);
    z_m[i] += height_m_ * bell(table, u);
  }
}

// Returns an upper bound of the curvature within the disc. At r standard deviations the height is h·exp(-r²/2). Its
// second derivative along a line is (t² - 1)·h·exp(-r²/2)/sd² with t ≤ r, the component of the distance along the
// line: in magnitude at most max(1, r² - 1)·h·exp(-r²/2)/sd², which falls from r = 0 and has a second peak at r = √3.
double Hill::curvature_1_m(const Disc& disc) const {
  if (!overlap(disc, reach_)) return 0;
  const double dx = disc.x_m - reach_.x_m, dy = disc.y_m - reach_.y_m;
  const double along = ax_ * dx + ay_ * dy, across = cx_ * dx + cy_ * dy;
  const double r = std::sqrt(along * along + across * across) - disc.radius_m / least_sd_m_;
  if (r >= kCutOff) return 0;
  constexpr double kSecondPeak = 0.4463;  // 2·exp(-3/2)
  double share = 1;
  if (r > 0) {
    const double e = bell(bell_table().data(), 0.5 * r * r);
    // The disc's nearest point is at r; the bound is the largest value there or farther out.
    share = r * r < 3 ? std::max(kSecondPeak, e) : (r * r - 1) * e;
  }
  return std::abs(height_m_) * share / (least_sd_m_ * least_sd_m_);
}

}  // namespace foldcar
