#include "side_view_terms.h"

#include <algorithm>
#include <cmath>

#include "body_spec.h"

namespace foldcar {
namespace {

// The q from which a tyre stands on its lower edge: 0.02 lifts the other edge of a 12 mm tyre by 0.24 mm.
constexpr double kEdgeRoll = 0.02;

}  // namespace

double sin_roll_limited(double q) { return std::clamp(q, -kMaxSinRoll, kMaxSinRoll); }

double cos_roll(double q) {
  const double limited = sin_roll_limited(q);
  return std::sqrt(1 - limited * limited);
}

double tan_roll(double q) { return sin_roll_limited(q) / cos_roll(q); }

double load_roll_couple_n_m(const CarriedLoad& load, double q) {
  const double leaning_n_m = -0.5 * load.width_n_m * std::clamp(q / kEdgeRoll, -1.0, 1.0);
  return load.height_n_m * tan_roll(q) + load.middle_n_m + leaning_n_m;
}

double offset_roll_couple_n_m(double side_moment_kg_m) { return -kGravity_m_s2 * side_moment_kg_m; }

}  // namespace foldcar
