#include "side_motion.h"

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

// Contacts are few: rounds enough for the last one to be heard by the first.
constexpr int kRounds = 4;

}  // namespace

double SideMotion::heading_inertia_kg_m2(double pitch_rad) const {
  const double s = std::sin(pitch_rad), c = std::cos(pitch_rad);
  return car_.roll_kg_m2 * s * s + car_.yaw_kg_m2 * c * c;
}

void SideMotion::step(double step_s, const PlaneRates& plane, std::vector<GroundContact>& contacts) {
  const double sine = std::sin(plane.pitch_rad);
  const double heading_kg_m2 = heading_inertia_kg_m2(plane.pitch_rad);
  // Without friction: a change of roll turns a pitched car; the frame of the heading turns below the car; and roll is
  // what the plane would have made of it with the car's own inertia and without the couple given in advance.
  const double roll_on_yaw = sine * plane.roll_rate_rad_s;
  const double added_n_m_s = (plane.roll_inertia_kg_m2 - car_.roll_kg_m2) * (plane.roll_rate_rad_s - roll_rate_rad_s_);
  double turn = plane.yaw_rate_rad_s -
                (plane.grip_n_m_s + car_.roll_kg_m2 * (roll_on_yaw - roll_on_yaw_rad_s_)) / heading_kg_m2;
  double drift = drift_m_s_ - plane.speed_m_s * plane.yaw_rate_rad_s * step_s;
  double roll = plane.roll_rate_rad_s + (added_n_m_s - given_n_m_s_) / car_.roll_kg_m2;
  const auto push = [&](const GroundContact& contact, double side_n_s) {
    drift += side_n_s / car_.mass_kg;
    turn += contact.ahead_m * side_n_s / heading_kg_m2;
    roll += contact.depth_m * side_n_s / car_.roll_kg_m2;
  };
  for (GroundContact& contact : contacts) {
    contact.side_n_s = 0;
    contact.kept_tangent_n_s = contact.tangent_n_s;
    push(contact, contact.push_n_s);
  }
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t n = 0; n < contacts.size(); ++n) {
      GroundContact& contact = contacts[round % 2 == 0 ? n : contacts.size() - 1 - n];
      const double slip_m_s = drift + contact.ahead_m * turn + contact.depth_m * roll;
      const double per_impulse = 1 / car_.mass_kg + contact.ahead_m * contact.ahead_m / heading_kg_m2 +
                                 contact.depth_m * contact.depth_m / car_.roll_kg_m2;
      // Friction opposes the slip as a whole: what would end it in either direction, in one measure, is shortened to what
      // the contact can give. A wheel slips the more in the plane the less it is held there; a belly is dragged on anyway.
      const double side_wish = contact.side_n_s - slip_m_s / per_impulse;
      const double way = contact.tangent_n_s < 0 ? -1 : 1;
      double tangent_wish = contact.tangent_n_s;
      if (contact.slip_mass_kg > 0) {
        const double lost_n_s = contact.tangent_n_s - contact.kept_tangent_n_s;
        const double plane_slip_m_s = way * (contact.slip_m_s + lost_n_s / contact.slip_mass_kg);
        tangent_wish = contact.kept_tangent_n_s + way * std::max(0.0, plane_slip_m_s) / per_impulse;
      }
      const double wish = std::sqrt(side_wish * side_wish + tangent_wish * tangent_wish);
      const double share = wish > contact.limit_n_s ? contact.limit_n_s / wish : 1;
      const double tangent = way * std::clamp(share * way * tangent_wish, 0.0, way * contact.tangent_n_s);
      push(contact, share * side_wish - contact.side_n_s);
      turn -= contact.left_m * contact.tangent_x * (tangent - contact.kept_tangent_n_s) / heading_kg_m2;
      contact.side_n_s = share * side_wish;
      contact.kept_tangent_n_s = tangent;
    }
  }
  double grip_n_m_s = 0;
  given_n_m_s_ = added_n_m_s;
  for (const GroundContact& contact : contacts) {
    given_n_m_s_ += contact.depth_m * (contact.side_n_s + contact.push_n_s);
    grip_n_m_s += contact.ahead_m * contact.side_n_s;
  }
  const double yaw_on_roll = sine * turn;
  roll_couple_n_m_ = (given_n_m_s_ - car_.roll_kg_m2 * (yaw_on_roll - yaw_on_roll_rad_s_)) / step_s;
  grip_n_m_ = std::abs(grip_n_m_s) / step_s;
  drift_m_s_ = drift;
  side_speed_m_s_ = drift + car_.com_height_m * plane.roll_rate_rad_s;
  yaw_rate_rad_s_ = turn;
  roll_rate_rad_s_ = plane.roll_rate_rad_s;
  roll_on_yaw_rad_s_ = roll_on_yaw;
  yaw_on_roll_rad_s_ = yaw_on_roll;
}

}  // namespace foldcar
