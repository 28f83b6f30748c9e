#include "twin_track_car.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "side_view_terms.h"
#include "standing_height.h"

namespace foldcar {
namespace {

// Time constants of the low-pass filters on quantities that are one step late: a few steps at 240 Hz, short against the
// car's own motions (tenths of a second).
constexpr double kRotorFilter_s = 0.006;
constexpr double kYawRateFilter_s = 0.019;

// The tracks' mass is set anew when the yaw inertia, which depends on pitch, has changed by this share.
constexpr double kInertiaTolerance = 0.02;
// The tracks are moved once their positions differ this much from those of the heading.
constexpr double kTrackTolerance_m = 3e-4;

// Factor on the iterations for a car with hinges, through whose segments impulses have to pass. With fewer iterations
// the wheel loads oscillate from step to step.
constexpr int kHingedIterationFactor = 2;

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
      lateral_({constants_.mass_kg, constants_.com_height_m, constants_.roll_inertia_kg_m2,
             constants_.yaw_inertia_kg_m2}),
      track_inertia_kg_m2_(constants_.yaw_inertia_kg_m2),
      wheels_(body.wheels.size()),
      rotor_gain_(filter_gain(step_s_, kRotorFilter_s)),
      yaw_rate_gain_(filter_gain(step_s_, kYawRateFilter_s)) {
  world_.SetContinuousPhysics(false);
  world_.SetAllowSleeping(false);
  world_.SetWarmStarting(true);
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    const WheelSpec& spec = body.wheels[i];
    const double spin_kg_m2 = 0.5 * spec.mass_kg * spec.radius_m * spec.radius_m + spec.servo.rotor_inertia_kg_m2;
    wheels_[i].slip_mass_kg = 1 / (1 / constants_.mass_kg + spec.radius_m * spec.radius_m / spin_kg_m2);
  }
  for (std::size_t i = 0; i < body.wheels.size(); ++i) {
    for (std::size_t j = 0; j < body.wheels.size(); ++j) {
      const WheelSpec &left = body.wheels[i], &right = body.wheels[j];
      const bool pair = left.side == CarSide::kLeft && right.side == CarSide::kRight &&
                        left.segment == right.segment && left.x_m == right.x_m;
      if (pair) axles_.emplace_back(i, j);
    }
  }
  put_down(start);
}

void TwinTrackCar::put_down(const PoseSpec& start) {
  const double reference_m = main_.com_x_m;
  heading_rad_ = state_.heading_rad = start.heading_rad;
  com_x_m_ = start.x_m + reference_m * std::cos(heading_rad_);
  com_y_m_ = start.y_m + reference_m * std::sin(heading_rad_);
  ground_.cut({{com_x_m_, com_y_m_, heading_rad_}, reference_m, 0});
  double side_m[2] = {std::numeric_limits<double>::lowest(), std::numeric_limits<double>::lowest()};
  for (const WheelSpec& wheel : body_.wheels) {
    const int k = static_cast<int>(wheel.side);
    const double s_m = wheel.x_m - reference_m;
    side_m[k] = std::max(side_m[k], axle_height_m(ground_.wheels(k), s_m, wheel));
  }
  const double q = sin_roll_limited((side_m[0] - side_m[1]) / body_.track_m);
  double axle_z_m = 0.5 * (side_m[0] + side_m[1]);
  for (const SegmentSpec& segment : body_.segments) {
    axle_z_m = std::max(axle_z_m, resting_axle_height_m(ground_.belly(), segment, reference_m));
  }
  car_ = build_mechanism(world_, body_, constants_, friction_, axle_z_m + options_.drop_m, q);
  const double weight_n = constants_.mass_kg * kGravity_m_s2;
  load_ = {constants_.com_height_m * weight_n, 0, constants_.tyre_width_m * weight_n};
  last_s_m_ = to_metres(car_.chassis->GetPosition().x);
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    update_wheel_friction(i, to_metres(car_.wheel[i]->GetPosition().x));
  }
  update_belly_friction();
  cut_terrain_if_stale();
  ground_.apply(car_);
  update_state();
}

void TwinTrackCar::cut_terrain_if_stale() {
  const CutPose pose{{com_x_m_, com_y_m_, heading_rad_},
                     to_metres(car_.chassis->GetPosition().x),
                     sin_roll_limited(car_.roll->GetAngle())};
  if (!ground_.stale(pose)) return;
  const ScopedTimer timer(stopwatch_ != nullptr ? &stopwatch_->terrain_s : nullptr);
  ground_.cut(pose);
  ground_.apply(car_);
}

void TwinTrackCar::step(const PulsesUs& pulses_us) {
  cut_terrain_if_stale();
  drive_wheels(pulses_us);
  apply_roll_couples();
  apply_yaw_couples();
  {
    const bool timed = stopwatch_ != nullptr && steps_++ % kTimedStepInterval == 0;
    const ScopedTimer timer(timed ? &stopwatch_->physics_s : nullptr, kTimedStepInterval);
    const int iteration_factor = body_.hinges.empty() ? 1 : kHingedIterationFactor;
    world_.Step(static_cast<float>(step_s_),
                iteration_factor * (impact_ ? options_.impact_iterations : options_.velocity_iterations),
                iteration_factor * options_.position_iterations);
  }
  advance_pose();
  read_contacts();
  resolve_friction();
  balance_axle_loads();
  update_state();
}

void TwinTrackCar::drive_wheels(const PulsesUs& pulses_us) {
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    const WheelSpec& spec = body_.wheels[i];
    WheelState& wheel = wheels_[i];
    const double omega = wheel_speed_rad_s(i);
    const ServoDrive drive = servo_drive(spec.servo, pulses_us[static_cast<std::size_t>(spec.channel)]);
    const double torque_n_m = servo_torque_n_m(spec.servo, drive, omega, body_.supply_v);
    // The joint's motor applies its largest torque until it reaches its speed: the torque is set to the servo's, the
    // speed to the no-load speed.
    const double no_load_rad_s =
        drive.fraction * spec.servo.no_load_speed_rad_s * body_.supply_v / spec.servo.rated_v;
    car_.wheel_motor[i]->SetMotorSpeed(static_cast<float>(-no_load_rad_s));
    car_.wheel_motor[i]->SetMaxMotorTorque(to_torque_units(std::abs(torque_n_m)));
    // The torque that accelerates the rotor is internal to the gearbox: only the rest reacts on the frame. The joint's
    // motor reacts with all of it, so the rotor's part is given back, late by the filter. Where the frames' inertia
    // contains the rotors, only the wheel's absolute acceleration is left to give back.
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
  const double q = car_.roll->GetAngle() + step_s_ * car_.roll->GetAngularVelocity();
  const double couple_n_m =
      load_roll_couple_n_m(load_, q) + offset_roll_couple_n_m(constants_.side_moment_kg_m) + lateral_.roll_couple_n_m();
  // Limit of three times weight times track, far above any tipping couple: it bounds the effect of simultaneous
  // impacts.
  const double limit_n_m = 3 * constants_.mass_kg * kGravity_m_s2 * body_.track_m;
  car_.roll->ApplyTorque(to_torque_units(std::clamp(couple_n_m, -limit_n_m, limit_n_m)), true);
}

void TwinTrackCar::apply_yaw_couples() {
  const double inertia_kg_m2 = lateral_.heading_inertia_kg_m2(car_.chassis->GetAngle());
  const bool stale = std::abs(inertia_kg_m2 - track_inertia_kg_m2_) > kInertiaTolerance * track_inertia_kg_m2_;
  if (stale) track_inertia_kg_m2_ = inertia_kg_m2;
  for (int k = 0; k < 2; ++k) {
    const double sign = k == 0 ? 1 : -1;
    if (stale) set_mass(*car_.track[k], track_mass_kg(inertia_kg_m2, body_.track_m), 1);
    // The scrub couple of the last step acts as friction on the tracks in this one; resolve_friction() corrects the
    // difference.
    car_.track_slide[k]->SetMaxMotorForce(to_units(lateral_.scrub_n_m() / body_.track_m));
    car_.track[k]->ApplyForceToCenter(to_units(sign * contact_yaw_n_m_ / body_.track_m, 0), true);
  }
}

void TwinTrackCar::advance_pose() {
  const double s_m = to_metres(car_.chassis->GetPosition().x);
  const double yaw_m = to_metres(car_.track[0]->GetPosition().x - car_.track[1]->GetPosition().x);
  const double d_s_m = s_m - last_s_m_;
  const double d_heading_rad = (yaw_m - last_yaw_m_) / body_.track_m;
  last_s_m_ = s_m;
  last_yaw_m_ = yaw_m;
  const double middle_rad = heading_rad_ + 0.5 * d_heading_rad;
  const double c = std::cos(middle_rad), s = std::sin(middle_rad);
  // The lateral speed is that of the whole car's centre of mass, the pose that of the main segment's.
  const double sideways_m =
      lateral_.lateral_speed_m_s() * step_s_ + (main_.com_x_m - constants_.com_x_m) * d_heading_rad;
  com_x_m_ += d_s_m * c - sideways_m * s;
  com_y_m_ += d_s_m * s + sideways_m * c;
  heading_rad_ += d_heading_rad;
}

b2Vec2 TwinTrackCar::chassis_velocity() const {
  const b2Vec2 units = car_.chassis->GetLinearVelocityFromLocalPoint(b2Vec2_zero);
  return (1 / static_cast<float>(kUnitsPerMetre)) * units;
}

// Friction in the plane ignores the lateral slip of a contact. The lateral dynamics limit both components together; the
// tangential impulse that is lost and the change of the yaw rate are applied to the plane.
void TwinTrackCar::resolve_friction() {
  PlaneRates plane;
  plane.pitch_rad = car_.chassis->GetAngle();
  plane.speed_m_s = chassis_velocity().x;
  plane.roll_rate_rad_s = car_.roll->GetAngularVelocity();
  plane.roll_inertia_kg_m2 = car_.roll->GetInertia() / kTorqueScale + constants_.frames_roll_kg_m2;
  plane.yaw_rate_rad_s =
      to_metres(car_.track[0]->GetLinearVelocity().x - car_.track[1]->GetLinearVelocity().x) / body_.track_m;
  for (int k = 0; k < 2; ++k) {
    const double force_n = to_metres(car_.track_slide[k]->GetMotorForce(static_cast<float>(1 / step_s_)));
    plane.scrub_n_m_s += (k == 0 ? 0.5 : -0.5) * body_.track_m * force_n * step_s_;
  }
  lateral_.step(step_s_, plane, contacts_);
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const double lost_n_s = contacts_[i].limited_tangent_n_s - contacts_[i].tangent_n_s;
    if (lost_n_s == 0) continue;
    const ContactPoint& point = contact_points_[i];
    point.body->ApplyLinearImpulse(to_units(lost_n_s) * point.tangent, point.position, true);
  }
  const double d_rate_m_s = (lateral_.yaw_rate_rad_s() - plane.yaw_rate_rad_s) * body_.track_m;
  // The plane moved with its own yaw rate during this step. The heading is corrected now, the tracks once the error is
  // worth moving them.
  heading_rad_ += d_rate_m_s * step_s_ / body_.track_m;
  track_error_m_ += d_rate_m_s * step_s_;
  const bool moves = std::abs(track_error_m_) > kTrackTolerance_m;
  for (int k = 0; k < 2; ++k) {
    const double sign = k == 0 ? 0.5 : -0.5;
    car_.track[k]->SetLinearVelocity(car_.track[k]->GetLinearVelocity() + b2Vec2(to_units(sign * d_rate_m_s), 0));
    if (!moves) continue;
    const b2Vec2 shift(to_units(sign * track_error_m_), 0);
    car_.track[k]->SetTransform(car_.track[k]->GetPosition() + shift, 0);
  }
  if (moves) {
    last_yaw_m_ = to_metres(car_.track[0]->GetPosition().x - car_.track[1]->GetPosition().x);
    track_error_m_ = 0;
  }
}

void TwinTrackCar::update_state() {
  const double pitch_rad = car_.chassis->GetAngle();
  const double q = std::clamp(static_cast<double>(car_.roll->GetAngle()), -1.0, 1.0);
  const double c = std::cos(pitch_rad), s = std::sin(pitch_rad);
  const double back_m = main_.com_x_m * c - main_.com_z_m * s;
  // Roll about the contacts moves the axle line, a wheel's radius above them, to the lower side.
  const double aside_m = -constants_.wheel_radius_m * q;
  state_.x_m = com_x_m_ - back_m * std::cos(heading_rad_) - aside_m * std::sin(heading_rad_);
  state_.y_m = com_y_m_ - back_m * std::sin(heading_rad_) + aside_m * std::cos(heading_rad_);
  state_.z_m = to_metres(car_.chassis->GetPosition().y) - main_.com_x_m * s - main_.com_z_m * c;
  yaw_rate_rad_s_ += yaw_rate_gain_ * ((heading_rad_ - state_.heading_rad) / step_s_ - yaw_rate_rad_s_);
  state_.heading_rad = heading_rad_;
  state_.pitch_rad = pitch_rad;
  state_.roll_rad = std::asin(q);
  state_.speed_m_s = chassis_velocity().x;
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
