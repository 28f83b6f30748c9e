#include "lateral_dynamics.h"

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

// Gauss-Seidel iterations over the contacts, in alternating order.
constexpr int kIterations = 4;

}  // namespace

double LateralDynamics::heading_inertia_kg_m2(double pitch_rad) const {
  const double s = std::sin(pitch_rad), c = std::cos(pitch_rad);
  return car_.roll_kg_m2 * s * s + car_.yaw_kg_m2 * c * c;
}

void LateralDynamics::step(double step_s, const PlaneRates& plane, std::vector<GroundContact>& contacts) {
  const double sine = std::sin(plane.pitch_rad);
  const double heading_kg_m2 = heading_inertia_kg_m2(plane.pitch_rad);
  // The velocities without lateral friction. Yaw: take out the scrub that the plane anticipated; a change of the roll
  // rate changes the yaw rate of a pitched car (coupling term of the kinetic energy). Lateral velocity: the heading's
  // frame rotates with the yaw rate. Roll: as if the plane had the car's own roll inertia and no couple in advance.
  const double roll_about_vertical_rad_s = sine * plane.roll_rate_rad_s;
  const double added_n_m_s = (plane.roll_inertia_kg_m2 - car_.roll_kg_m2) * (plane.roll_rate_rad_s - roll_rate_rad_s_);
  double yaw_rad_s =
      plane.yaw_rate_rad_s -
      (plane.scrub_n_m_s + car_.roll_kg_m2 * (roll_about_vertical_rad_s - roll_about_vertical_rad_s_)) / heading_kg_m2;
  double lateral_m_s = com_lateral_m_s_ - plane.speed_m_s * plane.yaw_rate_rad_s * step_s;
  double roll_rad_s = plane.roll_rate_rad_s + (added_n_m_s - roll_impulse_n_m_s_) / car_.roll_kg_m2;
  const auto apply = [&](const GroundContact& contact, double lateral_n_s) {
    lateral_m_s += lateral_n_s / car_.mass_kg;
    yaw_rad_s += contact.ahead_m * lateral_n_s / heading_kg_m2;
    roll_rad_s += contact.depth_m * lateral_n_s / car_.roll_kg_m2;
  };
  for (GroundContact& contact : contacts) {
    contact.lateral_n_s = 0;
    contact.limited_tangent_n_s = contact.tangent_n_s;
    apply(contact, contact.slope_n_s);
  }
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (std::size_t n = 0; n < contacts.size(); ++n) {
      GroundContact& contact = contacts[iteration % 2 == 0 ? n : contacts.size() - 1 - n];
      const double slip_m_s = lateral_m_s + contact.ahead_m * yaw_rad_s + contact.depth_m * roll_rad_s;
      const double inverse_mass_1_kg = 1 / car_.mass_kg + contact.ahead_m * contact.ahead_m / heading_kg_m2 +
                                       contact.depth_m * contact.depth_m / car_.roll_kg_m2;
      // Projection onto the friction circle: the impulses that would stop the slip in either direction, both for the
      // same effective mass, are scaled down together to the friction limit. A wheel slips more along its tangent the
      // less of the tangential impulse is left to it; for a belly the plane's impulse itself is taken.
      const double stop_lateral_n_s = contact.lateral_n_s - slip_m_s / inverse_mass_1_kg;
      const double sign = contact.tangent_n_s < 0 ? -1 : 1;
      double stop_tangent_n_s = contact.tangent_n_s;
      if (contact.slip_mass_kg > 0) {
        const double lost_n_s = contact.tangent_n_s - contact.limited_tangent_n_s;
        const double tangent_slip_m_s = sign * (contact.slip_m_s + lost_n_s / contact.slip_mass_kg);
        stop_tangent_n_s = contact.limited_tangent_n_s + sign * std::max(0.0, tangent_slip_m_s) / inverse_mass_1_kg;
      }
      const double stop_n_s = std::sqrt(stop_lateral_n_s * stop_lateral_n_s + stop_tangent_n_s * stop_tangent_n_s);
      const double scale = stop_n_s > contact.limit_n_s ? contact.limit_n_s / stop_n_s : 1;
      const double tangent_n_s =
          sign * std::clamp(scale * sign * stop_tangent_n_s, 0.0, sign * contact.tangent_n_s);
      apply(contact, scale * stop_lateral_n_s - contact.lateral_n_s);
      yaw_rad_s -=
          contact.left_m * contact.tangent_forward * (tangent_n_s - contact.limited_tangent_n_s) / heading_kg_m2;
      contact.lateral_n_s = scale * stop_lateral_n_s;
      contact.limited_tangent_n_s = tangent_n_s;
    }
  }
  double scrub_n_m_s = 0;
  roll_impulse_n_m_s_ = added_n_m_s;
  for (const GroundContact& contact : contacts) {
    roll_impulse_n_m_s_ += contact.depth_m * (contact.lateral_n_s + contact.slope_n_s);
    scrub_n_m_s += contact.ahead_m * contact.lateral_n_s;
  }
  const double yaw_about_forward_rad_s = sine * yaw_rad_s;
  roll_couple_n_m_ =
      (roll_impulse_n_m_s_ - car_.roll_kg_m2 * (yaw_about_forward_rad_s - yaw_about_forward_rad_s_)) / step_s;
  scrub_n_m_ = std::abs(scrub_n_m_s) / step_s;
  com_lateral_m_s_ = lateral_m_s;
  lateral_speed_m_s_ = lateral_m_s + car_.com_height_m * plane.roll_rate_rad_s;
  yaw_rate_rad_s_ = yaw_rad_s;
  roll_rate_rad_s_ = plane.roll_rate_rad_s;
  roll_about_vertical_rad_s_ = roll_about_vertical_rad_s;
  yaw_about_forward_rad_s_ = yaw_about_forward_rad_s;
}

}  // namespace foldcar
