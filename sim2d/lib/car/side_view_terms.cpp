#include "side_view_terms.h"

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

// Roll (as q) at which a tyre stands on its edge: two hundredths are a tenth of a millimetre across 12 mm.
constexpr double kEdgeRoll = 0.02;

}  // namespace

double sin_roll_limited(double q) { return std::clamp(q, -kMaxSinRoll, kMaxSinRoll); }

double cos_roll(double q) {
  const double limited = sin_roll_limited(q);
  return std::sqrt(1 - limited * limited);
}

double tan_roll(double q) { return sin_roll_limited(q) / cos_roll(q); }

double weight_roll_couple_n_m(double mass_kg, double com_height_m, double tyre_width_m, double q) {
  const double support_m = 0.5 * tyre_width_m * std::clamp(q / kEdgeRoll, -1.0, 1.0);
  return mass_kg * kGravity_m_s2 * (com_height_m * tan_roll(q) - support_m);
}

double offset_roll_couple_n_m(double side_moment_kg_m) { return -kGravity_m_s2 * side_moment_kg_m; }

double turning_roll_couple_n_m(double mass_kg, double com_height_m, double speed_m_s, double yaw_rate_rad_s) {
  return mass_kg * com_height_m * speed_m_s * yaw_rate_rad_s;
}

double friction_circle(double drive_ratio) {
  constexpr double kLeftOver = 0.04;
  return std::sqrt(std::max(kLeftOver, 1 - drive_ratio * drive_ratio));
}

double heading_step_rad(double d_yaw_rad, double d_pitch_rad, double pitch_rad, double q) {
  // Near a vertical chassis heading loses its meaning; the run ends as tipped before that.
  const double cos_pitch = std::max(0.3, std::cos(pitch_rad));
  return (d_yaw_rad / cos_roll(q) - d_pitch_rad * tan_roll(q)) / cos_pitch;
}

}  // namespace foldcar
