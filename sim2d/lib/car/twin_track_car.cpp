#include "twin_track_car.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "side_view_terms.h"

namespace foldcar {
namespace {

// Time constants of the couplings that lag a step behind the solver. Each is a few steps at 240 Hz: short
// against the car's own motions (tenths of a second), long enough that feeding contact forces back stays stable.
constexpr double kRotorFilter_s = 0.006;
constexpr double kBellyFilter_s = 0.006;
constexpr double kYawRateFilter_s = 0.019;

// The tracks' mass follows the pitched car's inertia in steps of this share.
constexpr double kInertiaTolerance = 0.02;
// The tracks are moved once they have come this far from where the heading wants them.
constexpr double kTrackTolerance_m = 3e-5;

// Impulses take this many times the iterations through a chain of segments; with fewer, loads flicker between wheels.
constexpr int kHingedRounds = 3;
// Share of a twist of loads that is evened out each step; all of it at once jerks a car that climbs.
constexpr float kUntwist = 0.5f;

double filter_gain(double step_s, double time_constant_s) { return 1 - std::exp(-step_s / time_constant_s); }

// Height that a wheel's axle needs at axle_s_m of the outline for the tyre to stand on it.
double axle_height_m(const Profile& profile, double axle_s_m, const WheelSpec& wheel) {
  const double radius_m = wheel.radius_m;
  const double x_m = axle_s_m + wheel.eccentricity_m * std::cos(wheel.eccentricity_phase_rad);
  double height_m = std::numeric_limits<double>::lowest();
  for (const ProfileSegment& segment : profile) {
    const double lo = std::max(segment.s0_m, x_m - radius_m), hi = std::min(segment.s1_m, x_m + radius_m);
    if (hi < lo) continue;
    const double nearest = std::clamp(x_m, lo, hi);
    for (const double s_m : {lo, nearest, hi}) {
      const double run = segment.s1_m - segment.s0_m;
      const double z_m =
          run > 0 ? segment.z0_m + (segment.z1_m - segment.z0_m) * (s_m - segment.s0_m) / run : segment.z0_m;
      const double dx = s_m - x_m;
      height_m = std::max(height_m, z_m + std::sqrt(std::max(0.0, radius_m * radius_m - dx * dx)));
    }
  }
  return height_m - wheel.eccentricity_m * std::sin(wheel.eccentricity_phase_rad);
}

// Height of the axles at which a segment's belly, put down inside an obstacle, rests on it.
double resting_axle_height_m(const Profile& ground, const SegmentSpec& segment, double reference_m) {
  const double middle_m = segment.x_m - reference_m;
  const double bottom_m = segment.center_z_m - 0.5 * segment.height_m;
  double height_m = std::numeric_limits<double>::lowest();
  for (const ProfileSegment& piece : ground) {
    if (piece.s1_m < middle_m - 0.5 * segment.length_m || piece.s0_m > middle_m + 0.5 * segment.length_m) continue;
    height_m = std::max(height_m, std::max(piece.z0_m, piece.z1_m) - bottom_m);
  }
  return height_m;
}

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
      side_(constants_.mass_kg, constants_.com_height_m, constants_.roll_inertia_kg_m2,
            constants_.yaw_inertia_kg_m2),
      track_inertia_kg_m2_(constants_.yaw_inertia_kg_m2),
      wheels_(body.wheels.size()),
      rotor_gain_(filter_gain(step_s_, kRotorFilter_s)),
      belly_gain_(filter_gain(step_s_, kBellyFilter_s)),
      yaw_rate_gain_(filter_gain(step_s_, kYawRateFilter_s)) {
  world_.SetContinuousPhysics(false);
  world_.SetAllowSleeping(false);
  world_.SetWarmStarting(true);
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    const WheelSpec& spec = body.wheels[i];
    const double spin_kg_m2 = 0.5 * spec.mass_kg * spec.radius_m * spec.radius_m + spec.servo.rotor_inertia_kg_m2;
    wheels_[i].rim_mass_kg = spin_kg_m2 / (spec.radius_m * spec.radius_m);
  }
  put_down(start);
  for (std::size_t i = 0; i < body.wheels.size(); ++i) {
    for (std::size_t j = 0; j < body.wheels.size(); ++j) {
      const WheelSpec &left = body.wheels[i], &right = body.wheels[j];
      const bool pair = left.side == CarSide::kLeft && right.side == CarSide::kRight &&
                        left.segment == right.segment && left.x_m == right.x_m;
      if (pair) axles_.emplace_back(i, j);
    }
  }
}

void TwinTrackCar::put_down(const PoseSpec& start) {
  const double reference_m = main_.com_x_m;
  heading_rad_ = start.heading_rad;
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
  tyre_load_n_ = constants_.mass_kg * kGravity_m_s2;
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
  share_friction();
  untwist_loads();
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
  const double q = car_.roll->GetAngle() + step_s_ * car_.roll->GetAngularVelocity();
  const double couple_n_m =
      load_roll_couple_n_m(tyre_load_n_, constants_.com_height_m, constants_.tyre_width_m, q) +
      turning_roll_couple_n_m(constants_.mass_kg, constants_.com_height_m, chassis_velocity().x, yaw_rate_rad_s_) +
      offset_roll_couple_n_m(constants_.side_moment_kg_m) + belly_roll_couple_n_m_ + side_.roll_couple_n_m();
  // A few times what could ever tip the car: contacts that meet in one step cannot throw it further.
  const double most_n_m = 3 * constants_.mass_kg * kGravity_m_s2 * body_.track_m;
  car_.roll->ApplyTorque(to_torque_units(std::clamp(couple_n_m, -most_n_m, most_n_m)), true);
}

void TwinTrackCar::apply_yaw_couples() {
  const double inertia_kg_m2 = side_.heading_inertia_kg_m2(car_.chassis->GetAngle());
  const bool stale = std::abs(inertia_kg_m2 - track_inertia_kg_m2_) > kInertiaTolerance * track_inertia_kg_m2_;
  if (stale) track_inertia_kg_m2_ = inertia_kg_m2;
  for (int k = 0; k < 2; ++k) {
    const double sign = k == 0 ? 1 : -1;
    if (stale) set_mass(*car_.track[k], track_mass_kg(inertia_kg_m2, body_.track_m), 1);
    // What resisted turning in the last step does so within this one; share_friction() settles the difference.
    car_.track_slide[k]->SetMaxMotorForce(to_units(side_.grip_n_m() / body_.track_m));
    car_.track[k]->ApplyForceToCenter(to_units(sign * belly_yaw_couple_n_m_ / body_.track_m, 0), true);
  }
}

void TwinTrackCar::advance_pose() {
  const double s_m = to_metres(car_.chassis->GetPosition().x);
  const double yaw_m = to_metres(car_.track[0]->GetPosition().x - car_.track[1]->GetPosition().x);
  const double d_s_m = s_m - last_s_m_;
  const double d_heading_rad = (yaw_m - last_yaw_m_) / body_.track_m;
  last_s_m_ = s_m;
  last_yaw_m_ = yaw_m;
  yaw_rate_rad_s_ += yaw_rate_gain_ * (d_heading_rad / step_s_ - yaw_rate_rad_s_);
  const double middle_rad = heading_rad_ + 0.5 * d_heading_rad;
  const double c = std::cos(middle_rad), s = std::sin(middle_rad);
  // The sideways speed is that of the whole car's centre of mass; the pose is the main segment's.
  const double sideways_m =
      side_.side_speed_m_s() * step_s_ + (main_.com_x_m - constants_.com_x_m) * d_heading_rad;
  com_x_m_ += d_s_m * c - sideways_m * s;
  com_y_m_ += d_s_m * s + sideways_m * c;
  heading_rad_ += d_heading_rad;
}

b2Vec2 TwinTrackCar::chassis_velocity() const {
  const b2Vec2 units = car_.chassis->GetLinearVelocityFromLocalPoint(b2Vec2_zero);
  return (1 / static_cast<float>(kUnitsPerMetre)) * units;
}

// The plane's friction leaves out what a contact slides sideways: both are settled together, and the plane is corrected.
void TwinTrackCar::share_friction() {
  PlaneRates plane;
  plane.pitch_rad = car_.chassis->GetAngle();
  plane.speed_m_s = chassis_velocity().x;
  plane.roll_rate_rad_s = car_.roll->GetAngularVelocity();
  plane.yaw_rate_rad_s =
      to_metres(car_.track[0]->GetLinearVelocity().x - car_.track[1]->GetLinearVelocity().x) / body_.track_m;
  for (int k = 0; k < 2; ++k) {
    const double force_n = to_metres(car_.track_slide[k]->GetMotorForce(static_cast<float>(1 / step_s_)));
    plane.grip_n_m_s += (k == 0 ? 0.5 : -0.5) * body_.track_m * force_n * step_s_;
  }
  side_.step(step_s_, plane, contacts_);
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const double lost_n_s = contacts_[i].kept_tangent_n_s - contacts_[i].tangent_n_s;
    if (lost_n_s == 0) continue;
    touching_[i].body->ApplyLinearImpulse(to_units(lost_n_s) * touching_[i].tangent, touching_[i].place, true);
  }
  const double d_rate_m_s = (side_.yaw_rate_rad_s() - plane.yaw_rate_rad_s) * body_.track_m;
  // The step moved with the rate it had before: heading is put right at once, the tracks once it is worth it.
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

std::optional<std::size_t> TwinTrackCar::belly_of(const b2Body* a, const b2Body* b) const {
  for (std::size_t j = 0; j < car_.segments.size(); ++j) {
    if (car_.segments[j].chassis == a || car_.segments[j].chassis == b) return j;
  }
  return std::nullopt;
}

// Enters a contact point of the plane for share_friction(). into_car is the manifold's sign: +1 if its normal points
// into the car's body.
void TwinTrackCar::enter_contact(b2Body& body, const b2Body* ground, const b2WorldManifold& where, int point,
                                 const b2ManifoldPoint& impulses, float into_car, double left_m, double friction,
                                 double plane_mass_kg) {
  const b2Vec2 place = where.points[point];
  const b2Vec2 tangent = into_car * b2Cross(where.normal, 1.0f);
  const b2Vec2 from_com = place - car_.chassis->GetPosition();
  const double pitch_rad = car_.chassis->GetAngle();
  GroundContact contact;
  contact.ahead_m = to_metres(from_com.x) + main_.com_x_m - constants_.com_x_m;
  contact.left_m = left_m;
  contact.rolls = ground != nullptr;
  contact.depth_m = to_metres(std::sin(pitch_rad) * from_com.x - std::cos(pitch_rad) * from_com.y);
  contact.limit_n_s = friction * to_metres(impulses.normalImpulse);
  contact.tangent_n_s = to_metres(impulses.tangentImpulse);
  contact.tangent_x = tangent.x;
  b2Vec2 slip = -body.GetLinearVelocityFromWorldPoint(place);
  if (ground != nullptr) slip += ground->GetLinearVelocity();
  contact.slip_m_s = to_metres(b2Dot(slip, tangent));
  contact.plane_mass_kg = plane_mass_kg;
  contacts_.push_back(contact);
  touching_.push_back({&body, place, tangent});
}

void TwinTrackCar::read_contacts() {
  const double to_newton = 1 / (step_s_ * kUnitsPerMetre);
  for (WheelState& wheel : wheels_) {
    wheel.load_n = 0;
    wheel.support = nullptr;
  }
  tyre_load_n_ = 0;
  contacts_.clear();
  touching_.clear();
  double belly_roll_n_m = 0, belly_yaw_n_m = 0;
  const double q = car_.roll->GetAngle();
  const double belly_height_m = constants_.com_height_m - constants_.belly_clearance_m;
  if (terrain_.has_patches()) take_belly_friction();
  for (b2Contact* contact = world_.GetContactList(); contact != nullptr; contact = contact->GetNext()) {
    if (!contact->IsTouching()) continue;
    b2Body* a = contact->GetFixtureA()->GetBody();
    b2Body* b = contact->GetFixtureB()->GetBody();
    b2Manifold& manifold = *contact->GetManifold();
    const std::optional<std::size_t> touching = belly_of(a, b);
    b2WorldManifold where;
    contact->GetWorldManifold(&where);
    if (!touching) {
      for (std::size_t i = 0; i < wheels_.size(); ++i) {
        if (car_.wheel[i] != a && car_.wheel[i] != b) continue;
        const float into_car = car_.wheel[i] == b ? 1.0f : -1.0f;
        for (int j = 0; j < manifold.pointCount; ++j) {
          b2ManifoldPoint& point = manifold.points[j];
          if (point.normalImpulse <= 0) continue;
          wheels_[i].support = wheels_[i].load_n > 0 ? nullptr : &point;
          wheels_[i].load_n += point.normalImpulse * to_newton;
          const b2Vec2 force = point.normalImpulse * where.normal +
                               point.tangentImpulse * b2Cross(where.normal, 1.0f);
          tyre_load_n_ += into_car * force.y * to_newton;
          const WheelSpec& spec = body_.wheels[i];
          const std::size_t side = static_cast<std::size_t>(spec.side);
          const double left_m = (side == 0 ? 0.5 : -0.5) * body_.track_m * cos_roll(q);
          enter_contact(*car_.wheel[i], car_.track[side], where, j, point, into_car, left_m,
                        wheels_[i].friction * spec.grip, wheels_[i].rim_mass_kg);
        }
        if (!terrain_.has_patches()) continue;
        take_friction(i, to_metres(where.points[0].x));
        contact->ResetFriction();
      }
      continue;
    }
    b2Body& chassis = *car_.segments[*touching].chassis;
    const float into_car = b == &chassis ? 1.0f : -1.0f;  // the normal points from a to b
    const double grip = body_.segments[*touching].grip;
    for (int j = 0; j < manifold.pointCount; ++j) {
      const b2ManifoldPoint& point = manifold.points[j];
      if (point.normalImpulse <= 0) continue;
      const b2Vec2 force = static_cast<float>(into_car * to_newton) *
                           (point.normalImpulse * where.normal + point.tangentImpulse * b2Cross(where.normal, 1.0f));
      const double contact_s_m = to_metres(where.points[j].x);
      const double y_m = ground_.belly_contact_y_m(contact_s_m);
      belly_roll_n_m += force.y * (y_m + belly_height_m * tan_roll(q));
      belly_yaw_n_m -= force.x * y_m;
      const double friction = friction_at(contact_s_m, y_m);
      if (terrain_.has_patches()) contact->SetFriction(static_cast<float>(friction * grip));
      enter_contact(chassis, nullptr, where, j, point, into_car, y_m, friction * grip, constants_.mass_kg);
    }
  }
  belly_roll_couple_n_m_ += belly_gain_ * (belly_roll_n_m - belly_roll_couple_n_m_);
  belly_yaw_couple_n_m_ += belly_gain_ * (belly_yaw_n_m - belly_yaw_couple_n_m_);
}

// On stiff ground nothing says how axles share a difference of load between left and right: the solver, which takes
// contacts in turn, lets it build up with opposite signs. Tyres would share it alike. What the solver starts its
// next step from is evened out so; it still makes every contact hold.
void TwinTrackCar::untwist_loads() {
  float mean = 0;
  for (const auto& [left, right] : axles_) {
    const b2ManifoldPoint *a = wheels_[left].support, *b = wheels_[right].support;
    if (a == nullptr || b == nullptr) return;
    mean += 0.5f * (a->normalImpulse - b->normalImpulse) / static_cast<float>(axles_.size());
  }
  for (const auto& [left, right] : axles_) {
    float &a = wheels_[left].support->normalImpulse, &b = wheels_[right].support->normalImpulse;
    const float shift = std::clamp(kUntwist * (mean - 0.5f * (a - b)), -a, b);
    a += shift;
    b -= shift;
  }
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

void TwinTrackCar::update_state() {
  const double pitch_rad = car_.chassis->GetAngle();
  const double q = std::clamp(static_cast<double>(car_.roll->GetAngle()), -1.0, 1.0);
  const double c = std::cos(pitch_rad), s = std::sin(pitch_rad);
  const double back_m = main_.com_x_m * c - main_.com_z_m * s;
  // Rolling about the contacts carries the axles, a wheel's radius over them, to the side that is down.
  const double aside_m = -constants_.wheel_radius_m * q;
  state_.x_m = com_x_m_ - back_m * std::cos(heading_rad_) - aside_m * std::sin(heading_rad_);
  state_.y_m = com_y_m_ - back_m * std::sin(heading_rad_) + aside_m * std::cos(heading_rad_);
  state_.z_m = to_metres(car_.chassis->GetPosition().y) - main_.com_x_m * s - main_.com_z_m * c;
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
    const double inertia = body->GetInertia() - body->GetMass() * body->GetLocalCenter().LengthSquared();
    energy += 0.5 * body->GetMass() * speed_squared + 0.5 * inertia * omega * omega;
    energy += body->GetMass() * body->GetGravityScale() * to_units(kGravity_m_s2) * body->GetWorldCenter().y;
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
