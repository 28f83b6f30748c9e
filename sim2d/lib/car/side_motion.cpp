#include "side_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace foldcar {
namespace {

// All contacts at once, each for its share of the load, so that their order, left or right first, does not matter:
// a handful with two unknowns; more rounds change nothing.
constexpr int kRounds = 20;

}  // namespace

SideMotion::SideMotion(double mass_kg, double com_height_m, double roll_inertia_kg_m2, double yaw_inertia_kg_m2)
    : mass_kg_(mass_kg),
      com_height_m_(com_height_m),
      roll_inertia_kg_m2_(roll_inertia_kg_m2),
      yaw_inertia_kg_m2_(yaw_inertia_kg_m2) {}

double SideMotion::heading_inertia_kg_m2(double pitch_rad) const {
  const double s = std::sin(pitch_rad), c = std::cos(pitch_rad);
  return roll_inertia_kg_m2_ * s * s + yaw_inertia_kg_m2_ * c * c;
}

void SideMotion::step(double step_s, const PlaneRates& plane, std::vector<GroundContact>& contacts) {
  const double sine = std::sin(plane.pitch_rad);
  const double inertia_kg_m2 = heading_inertia_kg_m2(plane.pitch_rad);
  // Without friction: a change of roll carries the contacts sideways and, on a pitched car, turns it; the frame of
  // the heading turns below the car.
  const double roll_on_yaw = sine * plane.roll_rate_rad_s;
  double turn = plane.yaw_rate_rad_s - (plane.grip_n_m_s + roll_inertia_kg_m2_ * (roll_on_yaw - roll_on_yaw_rad_s_)) /
                                           inertia_kg_m2;
  double slide = side_speed_m_s_ + com_height_m_ * (plane.roll_rate_rad_s - roll_rate_rad_s_) -
                 plane.speed_m_s * plane.yaw_rate_rad_s * step_s;
  for (GroundContact& contact : contacts) {
    contact.side_n_s = 0;
    contact.kept_tangent_n_s = contact.tangent_n_s;
  }
  double limits_n_s = std::numeric_limits<double>::min();  // no division by zero where the ground is ice
  for (const GroundContact& contact : contacts) limits_n_s += contact.limit_n_s;
  for (int round = 0; round < kRounds; ++round) {
    double push_n_s = 0, twist_n_m_s = 0;
    for (GroundContact& contact : contacts) {
      const double slip_m_s = slide + contact.ahead_m * turn + (contact.depth_m - com_height_m_) * plane.roll_rate_rad_s;
      const double mass_kg = contact.limit_n_s / limits_n_s /
                             (1 / mass_kg_ + contact.ahead_m * contact.ahead_m / inertia_kg_m2);
      // Friction opposes the slip as a whole: what would take it away in either direction, in one measure, is shortened
      // to what the contact can give. One that goes on sliding comes to give in the proportion of its slips, of which
      // the one in the plane grows as its friction is shortened.
      const double side_wish = contact.side_n_s - mass_kg * slip_m_s;
      const double way = contact.tangent_n_s < 0 ? -1 : 1;
      const double lost_n_s = contact.tangent_n_s - contact.kept_tangent_n_s;
      const double plane_slip_m_s = way * (contact.slip_m_s + lost_n_s / contact.plane_mass_kg);
      const double tangent_wish =
          way * contact.kept_tangent_n_s + std::min(mass_kg, contact.plane_mass_kg) * std::max(0.0, plane_slip_m_s);
      const double wish = std::hypot(side_wish, tangent_wish);
      const double share = wish > contact.limit_n_s ? contact.limit_n_s / wish : 1;
      const double side = share * side_wish;
      // A belly's edge that holds in the plane is left to hold.
      const double tangent =
          contact.rolls ? way * std::min(way * contact.tangent_n_s, share * tangent_wish) : contact.tangent_n_s;
      push_n_s += side - contact.side_n_s;
      twist_n_m_s += contact.ahead_m * (side - contact.side_n_s) -
                     contact.left_m * contact.tangent_x * (tangent - contact.kept_tangent_n_s);
      contact.side_n_s = side;
      contact.kept_tangent_n_s = tangent;
    }
    slide += push_n_s / mass_kg_;
    turn += twist_n_m_s / inertia_kg_m2;
  }
  double tilt_n_m_s = 0, grip_n_m_s = 0;
  for (const GroundContact& contact : contacts) {
    tilt_n_m_s += (contact.depth_m - com_height_m_) * contact.side_n_s;
    grip_n_m_s += contact.ahead_m * contact.side_n_s;
  }
  // The plane's roll inertia counts the mass as if its contacts never slid: what they do slide is made good here.
  const double yaw_on_roll = sine * turn;
  roll_couple_n_m_ = (com_height_m_ * mass_kg_ * (slide - side_speed_m_s_) + tilt_n_m_s -
                      roll_inertia_kg_m2_ * (yaw_on_roll - yaw_on_roll_rad_s_)) / step_s;
  grip_n_m_ = std::abs(grip_n_m_s) / step_s;
  side_speed_m_s_ = slide;
  yaw_rate_rad_s_ = turn;
  roll_rate_rad_s_ = plane.roll_rate_rad_s;
  roll_on_yaw_rad_s_ = roll_on_yaw;
  yaw_on_roll_rad_s_ = yaw_on_roll;
}

}  // namespace foldcar
