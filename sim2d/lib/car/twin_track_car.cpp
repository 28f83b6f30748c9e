#include "twin_track_car.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "side_view_terms.h"
#include "standing_height.h"

namespace foldcar {
namespace {

// Time constants of the couplings that lag a step behind the solver. Each is a few steps at 240 Hz: short
// against the car's own motions (tenths of a second), long enough that feeding contact forces back stays stable.
constexpr double kRotorFilter_s = 0.006;
constexpr double kScrubFilter_s = 0.008;
constexpr double kCentroidFilter_s = 0.019;
constexpr double kBellyFilter_s = 0.006;
constexpr double kYawRateFilter_s = 0.019;

// The tracks' mass follows the centroid of friction in steps of this.
constexpr double kCentroidTolerance_m = 0.002;
// Below this share of what the whole weight could give, friction has no centroid worth following.
constexpr double kLeastLoadShare = 0.05;

// Share of its friction with which a tyre that creeps along scrubs, at least.
constexpr double kLeastScrub = 0.5;

// Impulses take this many times the iterations through a chain of segments; with fewer, loads flicker between wheels.
constexpr int kHingedRounds = 4;

double filter_gain(double step_s, double time_constant_s) { return 1 - std::exp(-step_s / time_constant_s); }

}  // namespace

TwinTrackCar::TwinTrackCar(const BodySpec& body, double friction, const Terrain& terrain, const PoseSpec& start,
                           const StepOptions& options, Stopwatch* stopwatch)
    : body_(body),
      main_(body.segments[main_segment(body)]),
      friction_(friction),
      terrain_(terrain),
      constants_(body),
      options_(options),
      step_s_(1 / options.rate_hz),
      stopwatch_(stopwatch),
      world_(b2Vec2(0, -to_units(kGravity_m_s2))),
      ground_(terrain, body, constants_),
      wheels_(body.wheels.size()),
      rotor_gain_(filter_gain(step_s_, kRotorFilter_s)),
      scrub_gain_(filter_gain(step_s_, kScrubFilter_s)),
      centroid_gain_(filter_gain(step_s_, kCentroidFilter_s)),
      belly_gain_(filter_gain(step_s_, kBellyFilter_s)),
      yaw_rate_gain_(filter_gain(step_s_, kYawRateFilter_s)) {
  world_.SetContinuousPhysics(false);
  world_.SetAllowSleeping(false);
  world_.SetWarmStarting(true);
  put_down(start);
}

void TwinTrackCar::put_down(const PoseSpec& start) {
  const double reference_m = main_.com_x_m;
  heading_rad_ = start.heading_rad;
  com_x_m_ = start.x_m + reference_m * std::cos(heading_rad_);
  com_y_m_ = start.y_m + reference_m * std::sin(heading_rad_);
  ground_.cut({{com_x_m_, com_y_m_, heading_rad_}, reference_m, 0});
  double side_m[2] = {std::numeric_limits<double>::lowest(), std::numeric_limits<double>::lowest()};
  double weight_moment = 0;
  for (const WheelSpec& wheel : body_.wheels) {
    const int k = static_cast<int>(wheel.side);
    const double s_m = wheel.x_m - reference_m;
    side_m[k] = std::max(side_m[k], axle_height_m(ground_.wheels(k), s_m, wheel));
    weight_moment += std::abs(s_m);
  }
  const double q = sin_roll_limited((side_m[0] - side_m[1]) / body_.track_m);
  double axle_z_m = 0.5 * (side_m[0] + side_m[1]);
  for (const SegmentSpec& segment : body_.segments) {
    axle_z_m = std::max(axle_z_m, resting_axle_height_m(ground_.belly(), segment, reference_m));
  }
  car_ = build_mechanism(world_, body_, constants_, friction_, axle_z_m + options_.drop_m, q);
  const double weight_n = constants_.mass_kg * kGravity_m_s2;
  scrub_moment_n_m_ = friction_ * weight_n * weight_moment / static_cast<double>(body_.wheels.size());
  last_s_m_ = to_metres(car_.chassis->GetPosition().x);
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    take_friction(i, to_metres(car_.wheel[i]->GetPosition().x));
  }
  take_belly_friction();
  cut_terrain_if_stale();
  ground_.apply(car_);
  update_state();
}

void TwinTrackCar::cut_terrain_if_stale() {
  const CutPose pose{{com_x_m_, com_y_m_, heading_rad_},
                     to_metres(car_.chassis->GetPosition().x),
                     sin_roll_limited(car_.roll->GetAngle())};
  if (!ground_.stale(pose)) return;
  const Lap lap(stopwatch_ != nullptr ? &stopwatch_->terrain_s : nullptr);
  ground_.cut(pose);
  ground_.apply(car_);
}

void TwinTrackCar::step(const PulsesUs& pulses_us) {
  cut_terrain_if_stale();
  drive_wheels(pulses_us);
  apply_roll_couples();
  apply_yaw_couples();
  {
    const bool timed = stopwatch_ != nullptr && steps_++ % kSampledLaps == 0;
    const Lap lap(timed ? &stopwatch_->physics_s : nullptr, kSampledLaps);
    const int rounds = body_.hinges.empty() ? 1 : kHingedRounds;
    world_.Step(static_cast<float>(step_s_), rounds * options_.velocity_iterations,
                rounds * options_.position_iterations);
  }
  advance_pose();
  read_contacts();
  update_scrub();
  update_state();
}

void TwinTrackCar::drive_wheels(const PulsesUs& pulses_us) {
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    const WheelSpec& spec = body_.wheels[i];
    WheelState& wheel = wheels_[i];
    const double omega = wheel_speed_rad_s(i);
    const ServoDrive drive = servo_drive(spec.servo, pulses_us[static_cast<std::size_t>(spec.channel)]);
    const double torque_n_m = servo_torque_n_m(spec.servo, drive, omega, body_.supply_v);
    // The joint's motor gives its full torque as long as it has not reached its speed: aim at the no-load
    // speed, or at standstill of the excess when that is already passed.
    const double no_load_rad_s =
        drive.fraction * spec.servo.no_load_speed_rad_s * body_.supply_v / spec.servo.rated_v;
    car_.wheel_motor[i]->SetMotorSpeed(static_cast<float>(-no_load_rad_s));
    car_.wheel_motor[i]->SetMaxMotorTorque(to_torque_units(std::abs(torque_n_m)));
    // The rotor's spin-up is taken inside the gearbox: only what drives the wheel itself reacts on the frame.
    // It lags by its filter; a frame whose rotors are in its inertia feels only the wheel's own share of it.
    const double rotor_rad_s = car_.rotors_in_frames ? -car_.wheel[i]->GetAngularVelocity() : omega;
    const double acceleration = (rotor_rad_s - wheel.speed_rad_s) / step_s_;
    wheel.speed_rad_s = rotor_rad_s;
    wheel.acceleration_rad_s2 += rotor_gain_ * (acceleration - wheel.acceleration_rad_s2);
    const double limit_n_m = spec.servo.stall_torque_n_m;
    const double rotor_n_m =
        std::clamp(spec.servo.rotor_inertia_kg_m2 * wheel.acceleration_rad_s2, -limit_n_m, limit_n_m);
    const MechanismSegment& segment = car_.segments[static_cast<std::size_t>(spec.segment)];
    segment.frame[static_cast<std::size_t>(spec.side)]->ApplyTorque(to_torque_units(-rotor_n_m), true);
    state_.motor_work_j += torque_n_m * omega * step_s_;
    state_.consumed_energy_j += body_.supply_v * servo_current_a(spec.servo, drive, torque_n_m) * step_s_;
  }
}

void TwinTrackCar::apply_roll_couples() {
  const double q = car_.roll->GetAngle();
  const double speed_m_s = to_metres(car_.chassis->GetLinearVelocity().x);
  const double couple_n_m =
      weight_roll_couple_n_m(constants_.mass_kg, constants_.com_height_m, constants_.tyre_width_m, q) +
      turning_roll_couple_n_m(constants_.mass_kg, constants_.com_height_m, speed_m_s, yaw_rate_rad_s_) +
      offset_roll_couple_n_m(constants_.side_moment_kg_m) + belly_roll_couple_n_m_;
  car_.roll->ApplyTorque(to_torque_units(couple_n_m), true);
}

void TwinTrackCar::apply_yaw_couples() {
  // Scrub opposes the change of heading; a rolled car that pitches turns its own axes without any.
  const double q = sin_roll_limited(car_.roll->GetAngle());
  const double rest_m_s = 0.5 * body_.track_m * car_.chassis->GetAngularVelocity() * q;
  for (int k = 0; k < 2; ++k) {
    const double sign = k == 0 ? 1 : -1;
    car_.track_slide[k]->SetMaxMotorForce(to_units(scrub_moment_n_m_ / body_.track_m));
    car_.track_slide[k]->SetMotorSpeed(to_units(sign * rest_m_s));
    car_.track[k]->ApplyForceToCenter(to_units(sign * contact_yaw_couple_n_m_ / body_.track_m, 0), true);
  }
  if (std::abs(grip_centroid_m_ - track_inertia_centroid_m_) > kCentroidTolerance_m) {
    track_inertia_centroid_m_ = grip_centroid_m_;
    const double arm_m = grip_centroid_m_ + main_.com_x_m - constants_.com_x_m;
    const double inertia_kg_m2 = constants_.yaw_inertia_kg_m2 + constants_.mass_kg * arm_m * arm_m;
    for (b2Body* track : car_.track) set_mass(*track, track_mass_kg(inertia_kg_m2, body_.track_m), 1);
  }
}

void TwinTrackCar::advance_pose() {
  const double s_m = to_metres(car_.chassis->GetPosition().x);
  const double yaw_m = to_metres(car_.track[0]->GetPosition().x - car_.track[1]->GetPosition().x);
  const double pitch_rad = car_.chassis->GetAngle();
  const double q = sin_roll_limited(car_.roll->GetAngle());
  const double d_s_m = s_m - last_s_m_;
  const double d_heading_rad =
      heading_step_rad((yaw_m - last_yaw_m_) / body_.track_m, pitch_rad - last_pitch_rad_, pitch_rad, q);
  last_s_m_ = s_m;
  last_yaw_m_ = yaw_m;
  last_pitch_rad_ = pitch_rad;
  yaw_rate_rad_s_ += yaw_rate_gain_ * (d_heading_rad / step_s_ - yaw_rate_rad_s_);
  // The car turns about the centroid of friction, not about its centre of mass.
  const double middle_rad = heading_rad_ + 0.5 * d_heading_rad;
  const double c = std::cos(middle_rad), s = std::sin(middle_rad);
  const double sideways_m = -grip_centroid_m_ * d_heading_rad;
  com_x_m_ += d_s_m * c - sideways_m * s;
  com_y_m_ += d_s_m * s + sideways_m * c;
  heading_rad_ += d_heading_rad;
}

std::optional<std::size_t> TwinTrackCar::belly_of(const b2Body* a, const b2Body* b) const {
  for (std::size_t j = 0; j < car_.segments.size(); ++j) {
    if (car_.segments[j].chassis == a || car_.segments[j].chassis == b) return j;
  }
  return std::nullopt;
}

void TwinTrackCar::read_contacts() {
  const double to_newton = 1 / (step_s_ * kUnitsPerMetre);
  for (WheelState& wheel : wheels_) wheel.load_n = wheel.drive_force_n = 0;
  belly_roll_now_n_m_ = contact_yaw_now_n_m_ = belly_scrub_n_m_ = belly_grip_n_ = belly_grip_n_m_ = 0;
  const double s_m = to_metres(car_.chassis->GetPosition().x);
  if (terrain_.has_patches()) take_belly_friction();
  for (b2Contact* contact = world_.GetContactList(); contact != nullptr; contact = contact->GetNext()) {
    if (!contact->IsTouching()) continue;
    b2Body* a = contact->GetFixtureA()->GetBody();
    b2Body* b = contact->GetFixtureB()->GetBody();
    const b2Manifold& manifold = *contact->GetManifold();
    const std::optional<std::size_t> touching = belly_of(a, b);
    if (!touching) {
      for (std::size_t i = 0; i < wheels_.size(); ++i) {
        if (car_.wheel[i] != a && car_.wheel[i] != b) continue;
        contact->SetTangentSpeed(to_units(creep_m_s(i)));
        double normal_n = 0;
        for (int j = 0; j < manifold.pointCount; ++j) {
          normal_n += manifold.points[j].normalImpulse * to_newton;
          wheels_[i].drive_force_n += manifold.points[j].tangentImpulse * to_newton;
        }
        wheels_[i].load_n += normal_n;
        if (!terrain_.has_patches() && terrain_.ground() == nullptr) continue;
        b2WorldManifold where;
        contact->GetWorldManifold(&where);
        const double contact_s_m = to_metres(where.points[0].x);
        const double slope =
            ground_.side_slope(static_cast<int>(body_.wheels[i].side), contact_s_m, to_metres(where.points[0].y));
        const double aside_n = -slope * normal_n * std::abs(where.normal.y);
        contact_yaw_now_n_m_ += aside_n * (contact_s_m - s_m - grip_centroid_m_);
        if (!terrain_.has_patches()) continue;
        take_friction(i, contact_s_m);
        contact->ResetFriction();
      }
      continue;
    }
    b2WorldManifold where;
    contact->GetWorldManifold(&where);
    const double sign = b == car_.segments[*touching].chassis ? 1 : -1;  // the normal points from a to b
    const double grip = body_.segments[*touching].grip;
    const b2Vec2 tangent = b2Cross(where.normal, 1.0f);
    for (int j = 0; j < manifold.pointCount; ++j) {
      const double normal_n = manifold.points[j].normalImpulse * to_newton;
      const double tangent_n = manifold.points[j].tangentImpulse * to_newton;
      if (normal_n <= 0) continue;
      const double forward_n = sign * (normal_n * where.normal.x + tangent_n * tangent.x);
      const double upward_n = sign * (normal_n * where.normal.y + tangent_n * tangent.y);
      const double contact_s_m = to_metres(where.points[j].x);
      const double y_m = ground_.belly_contact_y_m(contact_s_m);
      belly_roll_now_n_m_ += upward_n * y_m;
      contact_yaw_now_n_m_ -= forward_n * y_m;
      const double friction = friction_at(contact_s_m, y_m);
      if (terrain_.has_patches()) contact->SetFriction(static_cast<float>(friction * grip));
      const double limit_n = friction * grip * normal_n, ahead_m = contact_s_m - s_m;
      belly_scrub_n_m_ += limit_n * std::abs(ahead_m - grip_centroid_m_);
      belly_grip_n_ += limit_n;
      belly_grip_n_m_ += limit_n * ahead_m;
    }
  }
  belly_roll_couple_n_m_ += belly_gain_ * (belly_roll_now_n_m_ - belly_roll_couple_n_m_);
  contact_yaw_couple_n_m_ += belly_gain_ * (contact_yaw_now_n_m_ - contact_yaw_couple_n_m_);
}

double TwinTrackCar::friction_at(double s_m, double y_m) const {
  if (!terrain_.has_patches()) return friction_;
  const double ahead_m = s_m - to_metres(car_.chassis->GetPosition().x);
  const double c = std::cos(heading_rad_), s = std::sin(heading_rad_);
  return terrain_.friction(com_x_m_ + c * ahead_m - s * y_m, com_y_m_ + s * ahead_m + c * y_m, friction_);
}

// Contacts that begin later start with their fixture's friction, so that is changed too.
void TwinTrackCar::take_friction(std::size_t wheel, double s_m) {
  const WheelSpec& spec = body_.wheels[wheel];
  const double side = spec.side == CarSide::kLeft ? 0.5 : -0.5;
  wheels_[wheel].friction = friction_at(s_m, side * body_.track_m * cos_roll(car_.roll->GetAngle()));
  car_.wheel[wheel]->GetFixtureList()->SetFriction(fixture_friction(wheels_[wheel].friction * spec.grip));
}

void TwinTrackCar::take_belly_friction() {
  for (std::size_t j = 0; j < car_.segments.size(); ++j) {
    b2Body& chassis = *car_.segments[j].chassis;
    const double friction = friction_at(to_metres(chassis.GetPosition().x), 0);
    chassis.GetFixtureList()->SetFriction(fixture_friction(friction * body_.segments[j].grip));
  }
}

double TwinTrackCar::grip_n(std::size_t wheel) const {
  return wheels_[wheel].friction * body_.wheels[wheel].grip * wheels_[wheel].load_n;
}

double TwinTrackCar::scrub_arm_m(std::size_t wheel) const {
  return body_.wheels[wheel].x_m - main_.com_x_m - grip_centroid_m_;
}

// Friction opposes the slip as a whole: a tyre that is dragged sideways creeps along too, in the proportion of its drive
// to its scrub; one that spins or is locked slides in the plane as it is. Signs are the solver's: slip is against friction.
double TwinTrackCar::creep_m_s(std::size_t wheel) const {
  const double ratio = wheels_[wheel].drive_ratio;
  return -std::abs(yaw_rate_rad_s_ * scrub_arm_m(wheel)) * ratio / std::max(kLeastScrub, friction_circle(ratio));
}

void TwinTrackCar::update_scrub() {
  // The centre about which turning meets the least friction, near enough.
  double all_grip_n = belly_grip_n_, moment_n_m = belly_grip_n_m_;
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    all_grip_n += grip_n(i);
    moment_n_m += grip_n(i) * (body_.wheels[i].x_m - main_.com_x_m);
  }
  const double weight_n = constants_.mass_kg * kGravity_m_s2;
  const double centroid_m = all_grip_n > kLeastLoadShare * friction_ * weight_n ? moment_n_m / all_grip_n : 0;
  grip_centroid_m_ += centroid_gain_ * (centroid_m - grip_centroid_m_);
  double scrub_n_m = belly_scrub_n_m_;
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    const double limit_n = grip_n(i);
    if (limit_n <= 0) continue;
    const double drive_ratio = std::min(1.0, std::abs(wheels_[i].drive_force_n) / limit_n);
    const double signed_ratio = std::copysign(drive_ratio, wheels_[i].drive_force_n);
    wheels_[i].drive_ratio += scrub_gain_ * (signed_ratio - wheels_[i].drive_ratio);
    scrub_n_m += limit_n * std::abs(scrub_arm_m(i)) * friction_circle(drive_ratio);
  }
  scrub_moment_n_m_ += scrub_gain_ * (scrub_n_m - scrub_moment_n_m_);
}

void TwinTrackCar::update_state() {
  const double pitch_rad = car_.chassis->GetAngle();
  const double q = std::clamp(static_cast<double>(car_.roll->GetAngle()), -1.0, 1.0);
  const double c = std::cos(pitch_rad), s = std::sin(pitch_rad);
  const double back_m = main_.com_x_m * c - main_.com_z_m * s;
  state_.x_m = com_x_m_ - back_m * std::cos(heading_rad_);
  state_.y_m = com_y_m_ - back_m * std::sin(heading_rad_);
  state_.z_m = to_metres(car_.chassis->GetPosition().y) - main_.com_x_m * s - main_.com_z_m * c;
  state_.heading_rad = heading_rad_;
  state_.pitch_rad = pitch_rad;
  state_.roll_rad = std::asin(q);
  state_.speed_m_s = to_metres(car_.chassis->GetLinearVelocity().x);
  state_.yaw_rate_rad_s = yaw_rate_rad_s_;
  state_.up = c * std::sqrt(1 - q * q);
}

double TwinTrackCar::wheel_speed_rad_s(std::size_t wheel) const {
  return -car_.wheel_motor[wheel]->GetJointSpeed();
}

double TwinTrackCar::hinge_rad(std::size_t hinge) const { return car_.hinge[hinge]->GetJointAngle(); }

double TwinTrackCar::mechanical_energy_j() const {
  double energy = 0;
  for (const b2Body* body = world_.GetBodyList(); body != nullptr; body = body->GetNext()) {
    if (body->GetType() != b2_dynamicBody) continue;
    const double speed_squared = body->GetLinearVelocity().LengthSquared();
    const double omega = body->GetAngularVelocity();
    energy += 0.5 * body->GetMass() * speed_squared + 0.5 * body->GetInertia() * omega * omega;
    energy += body->GetMass() * body->GetGravityScale() * to_units(kGravity_m_s2) * body->GetPosition().y;
  }
  energy /= kTorqueScale;
  for (std::size_t j = 0; j < car_.hinge.size(); ++j) {
    const double fold_rad = hinge_rad(j);
    energy += 0.5 * body_.hinges[j].stiffness_n_m_rad * fold_rad * fold_rad;
  }
  return energy;
}

bool TwinTrackCar::finite() const {
  for (const MechanismSegment& segment : car_.segments) {
    if (!segment.chassis->GetPosition().IsValid() || !std::isfinite(segment.chassis->GetAngle())) return false;
  }
  return std::isfinite(state_.x_m) && std::isfinite(state_.y_m) && std::isfinite(state_.z_m) &&
         std::isfinite(state_.heading_rad) && std::isfinite(state_.up);
}

}  // namespace foldcar
