#include "side_view_car.h"

#include <box2d/b2_distance.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "box2d_units.h"
#include "car_constants.h"
#include "elementary_functions.h"

namespace foldcar {
namespace {

// The smooth ground is made this far before and behind the car.
constexpr double kAhead_m = 0.05;

constexpr double kUnits2 = kUnitsPerMetre * kUnitsPerMetre;

// With its few iterations Box2D lets a car of this ratio of masses, in a segment and a pair of wheels, sink by 0.6 mm.
constexpr double kHeaviest = 100;

float to_torque(double n_m) { return static_cast<float>(n_m * kUnits2); }
float to_inertia(double kg_m2) { return static_cast<float>(kg_m2 * kUnits2); }

// Lets the joint's motor give a torque that falls to zero at goal_rad_s: it never drives beyond.
void drive(b2RevoluteJoint& joint, double torque_n_m, double goal_rad_s) {
  joint.EnableMotor(true);
  joint.SetMotorSpeed(static_cast<float>(goal_rad_s));
  joint.SetMaxMotorTorque(to_torque(std::abs(torque_n_m)));
}

// Returns the fraction of the translation that the car's shape moves before it meets the ground's; 1 if they do not
// meet.
float share_to_ground(const b2Fixture& part, const b2Fixture& ground, const b2Vec2& translation) {
  float share = 1;
  b2ShapeCastInput input;
  input.proxyB.Set(part.GetShape(), 0);
  input.transformA = ground.GetBody()->GetTransform();
  input.transformB = part.GetBody()->GetTransform();
  input.translationB = translation;
  for (int32 child = 0; child < ground.GetShape()->GetChildCount(); ++child) {
    input.proxyA.Set(ground.GetShape(), child);
    b2ShapeCastOutput output;
    if (b2ShapeCast(&output, &input)) share = std::min(share, output.lambda);
  }
  return share;
}

// Kinetic energy of a body. Box2D gives the inertia about the body's origin: it is moved to the centre of mass.
double kinetic_j(const b2Body& body) {
  const double inertia = body.GetInertia() - body.GetMass() * body.GetLocalCenter().LengthSquared();
  const double rate_rad_s = body.GetAngularVelocity();
  return 0.5 * (body.GetMass() * body.GetLinearVelocity().LengthSquared() + inertia * rate_rad_s * rate_rad_s) / kUnits2;
}

}  // namespace

SideViewCar::SideViewCar(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                         const SideViewOptions& options, Stopwatch* stopwatch)
    : body_(body),
      scene_(scene),
      terrain_(terrain),
      options_(options),
      main_(main_segment(body)),
      step_s_(1 / options.rate_hz),
      reach_m_(CarConstants(body).reach_m + std::abs(body.segments[main_].com_x_m) + kAhead_m),
      stopwatch_(stopwatch),
      world_({0, to_units(-kGravity_m_s2)}),
      ground_(world_, body, scene, terrain),
      supply_(body) {
  check_plain_tyres(body, "the side view");
  const ScopedTimer timer(stopwatch_ != nullptr ? &stopwatch_->terrain_s : nullptr);
  world_.SetAllowSleeping(false);
  // Nothing here passes through anything in a step.
  world_.SetContinuousPhysics(false);
  world_.SetContactListener(this);
  add_segments();
  pairs_.reserve(body.wheels.size());
  for (const WheelSpec& left : body.wheels) {
    if (left.side != CarSide::kLeft) continue;
    for (const WheelSpec& right : body.wheels) {
      if (right.side == CarSide::kRight && right.segment == left.segment && right.x_m == left.x_m) add_pair(left, right);
    }
  }
  check_masses();
  for (Pair& pair : pairs_) {
    const b2Body* segment = pair.joint->GetBodyA();
    double rotors_kg_m2 = 0;
    for (const Pair& one : pairs_) rotors_kg_m2 += one.joint->GetBodyA() == segment ? one.rotors_kg_m2 : 0;
    const double own = segment->GetInertia() - segment->GetMass() * segment->GetLocalCenter().LengthSquared();
    pair.settling = 1 / (1 + rotors_kg_m2 * kUnits2 / own);
  }
  ground_.extend(-reach_m_, reach_m_);
  place_on_ground(options.drop_m);
  state_.heading_rad = scene.start.heading_rad;
  update_state();
}

// Creates a body with a belly for every segment, and the hinges between them. With straight hinges all bodies have
// their origin at the car's.
void SideViewCar::add_segments() {
  b2BodyDef moving;
  moving.type = b2_dynamicBody;
  for (const SegmentSpec& spec : body_.segments) {
    b2Body* segment = world_.CreateBody(&moving);
    // Box2D's polygons have a skin.
    b2PolygonShape box;
    box.SetAsBox(to_units(0.5 * spec.length_m) - b2_polygonRadius, to_units(0.5 * spec.height_m) - b2_polygonRadius,
                 to_units(spec.x_m, spec.center_z_m), 0);
    b2FixtureDef fixture;
    fixture.shape = &box;
    fixture.filter.categoryBits = kBellyBit;
    fixture.filter.maskBits = kBellyGroundBit;
    fixture.userData.grip = &spec.grip;
    segment->CreateFixture(&fixture);
    b2MassData mass;
    mass.mass = static_cast<float>(spec.mass_kg);
    mass.center = to_units(spec.com_x_m, spec.com_z_m);
    // Box2D takes the inertia about the origin, and what is left of it in single precision must not be zero.
    const float shift = mass.mass * mass.center.LengthSquared();
    mass.I = std::max(to_inertia(spec.pitch_inertia_kg_m2) + shift, 1.000001f * shift);
    segment->SetMassData(&mass);
    segments_.push_back(segment);
  }
  for (std::size_t j = 0; j < body_.hinges.size(); ++j) {
    const HingeSpec& spec = body_.hinges[j];
    // The rear segment comes first: then the angle is positive with the front one's nose up.
    b2RevoluteJointDef joint;
    joint.Initialize(segments_[j + 1], segments_[j], to_units(spec.x_m, spec.z_m));
    joint.enableLimit = true;
    joint.lowerAngle = static_cast<float>(spec.min_rad);
    joint.upperAngle = static_cast<float>(spec.max_rad);
    hinges_.push_back(static_cast<b2RevoluteJoint*>(world_.CreateJoint(&joint)));
  }
}

// Creates one disc for a left and a right wheel: radius, eccentricity and grip are their means, mass and inertia the
// sums. The disc's inertia contains the servos' rotors; turn_rotors corrects for what they do to the segment.
void SideViewCar::add_pair(const WheelSpec& left, const WheelSpec& right) {
  Pair& pair = pairs_.emplace_back();
  pair.wheels[0].wheel = &left;
  pair.wheels[1].wheel = &right;
  double radius_m = 0, off_x_m = 0, off_z_m = 0, mass_kg = 0, inertia_kg_m2 = 0;
  for (const WheelSpec* wheel : {&left, &right}) {
    radius_m += 0.5 * wheel->radius_m;
    off_x_m += 0.5 * wheel->eccentricity_m * cosine(wheel->eccentricity_phase_rad);
    off_z_m += 0.5 * wheel->eccentricity_m * sine(wheel->eccentricity_phase_rad);
    mass_kg += wheel->mass_kg;
    inertia_kg_m2 += 0.5 * wheel->mass_kg * wheel->radius_m * wheel->radius_m;
    pair.rotors_kg_m2 += wheel->servo.rotor_inertia_kg_m2;
    pair.grip += 0.5 * wheel->grip;
  }
  b2BodyDef moving;
  moving.type = b2_dynamicBody;
  moving.position = to_units(left.x_m, 0);
  pair.disc = world_.CreateBody(&moving);
  b2CircleShape circle;
  circle.m_p = to_units(off_x_m, off_z_m);
  circle.m_radius = to_units(radius_m);
  b2FixtureDef fixture;
  fixture.shape = &circle;
  fixture.filter.categoryBits = kWheelBit;
  fixture.filter.maskBits = kWheelGroundBit;
  fixture.userData.grip = &pair.grip;
  pair.disc->CreateFixture(&fixture);
  b2MassData mass;
  mass.mass = static_cast<float>(mass_kg);
  mass.center.SetZero();
  mass.I = to_inertia(inertia_kg_m2 + pair.rotors_kg_m2);
  pair.disc->SetMassData(&mass);
  b2RevoluteJointDef joint;
  joint.Initialize(segments_[static_cast<std::size_t>(left.segment)], pair.disc, moving.position);
  pair.joint = static_cast<b2RevoluteJoint*>(world_.CreateJoint(&joint));
}

// Throws if a segment is too heavy for a pair of wheels (kHeaviest).
void SideViewCar::check_masses() const {
  for (const b2Body* segment : segments_) {
    for (const Pair& pair : pairs_) {
      if (segment->GetMass() <= kHeaviest * pair.disc->GetMass()) continue;
      throw std::runtime_error("body " + body_.id + ": a segment of " + std::to_string(segment->GetMass()) +
                               " kg is more than 100 times as heavy as a pair of wheels of " +
                               std::to_string(pair.disc->GetMass()) +
                               " kg: the side view would let it sink into the ground; multibody takes it");
    }
  }
}

// Puts the car drop_m above where it would first touch: lifts it clear of the ground, casts every part down on the
// ground and lowers all by the shortest way found.
void SideViewCar::place_on_ground(double drop_m) {
  float top = 0;
  for (const b2Fixture* one = ground_.body().GetFixtureList(); one != nullptr; one = one->GetNext()) {
    for (int32 child = 0; child < one->GetShape()->GetChildCount(); ++child) {
      b2AABB box;
      one->GetShape()->ComputeAABB(&box, ground_.body().GetTransform(), child);
      top = std::max(top, box.upperBound.y);
    }
  }
  const float high = top + to_units(reach_m_);
  const auto lift = [&](float by) {
    for (b2Body* one = world_.GetBodyList(); one != nullptr; one = one->GetNext()) {
      if (one->GetType() == b2_dynamicBody) one->SetTransform(one->GetPosition() + b2Vec2(0, by), 0);
    }
  };
  lift(high);
  const b2Vec2 down(0, -2 * high - to_units(1));
  float share = 1;
  for (const b2Body* body = world_.GetBodyList(); body != nullptr; body = body->GetNext()) {
    if (body->GetType() != b2_dynamicBody) continue;
    const b2Fixture& part = *body->GetFixtureList();
    for (const b2Fixture* one = ground_.body().GetFixtureList(); one != nullptr; one = one->GetNext()) {
      if ((one->GetFilterData().categoryBits & part.GetFilterData().maskBits) == 0) continue;
      share = std::min(share, share_to_ground(part, *one, down));
    }
  }
  lift(share * down.y + to_units(drop_m));
}

void SideViewCar::step(const PulsesUs& pulses_us) {
  const double x_m = to_metres(segments_[main_]->GetPosition().x);
  ground_.extend(x_m - reach_m_, x_m + reach_m_);
  const bool timed = stopwatch_ != nullptr && steps_++ % kTimedStepInterval == 0;
  for (Pair& pair : pairs_) pair.start_rad_s = -pair.joint->GetJointSpeed();
  {
    const ScopedTimer timer(timed ? &stopwatch_->physics_s : nullptr, kTimedStepInterval);
    drive_wheels(pulses_us);
    bend_hinges();
    turn_rotors([&] {
      world_.Step(static_cast<float>(step_s_), options_.velocity_iterations, options_.position_iterations);
    });
  }
  count_energy();
  update_state();
}

// Drives every pair's joint with the sum of both servos' torques. A servo's torque falls linearly with the rate; the
// sum of two such lines is a line too, and is zero at (sum of the torques at rest) / (sum of the slopes), the motor's
// goal.
void SideViewCar::drive_wheels(const PulsesUs& pulses_us) {
  for (Pair& pair : pairs_) {
    double torque_n_m = 0, drive_n_m = 0, slope = 0;
    for (Pair::Driven& one : pair.wheels) {
      const ServoSpec& spec = one.wheel->servo;
      one.servo = servo_drive(spec, pulses_us[static_cast<std::size_t>(one.wheel->channel)]);
      one.torque_n_m = servo_torque_n_m(spec, one.servo, pair.start_rad_s, supply_.voltage_v());
      if (!one.servo.powered) continue;
      torque_n_m += one.torque_n_m;
      drive_n_m += one.servo.fraction * spec.stall_torque_n_m * supply_.voltage_v() / spec.rated_v;
      slope += spec.stall_torque_n_m / spec.no_load_speed_rad_s;
    }
    if (slope == 0) {
      pair.joint->EnableMotor(false);
    } else {
      drive(*pair.joint, torque_n_m, -drive_n_m / slope);
    }
  }
}

// A rotor resists the wheel's rate relative to the segment, and its reaction stays in the gearbox. With I its inertia,
// τ the motor's torque and a_d, a_s the accelerations of disc and segment, their equations are
//
//   (I_disc + I) a_d = τ + I a_s,   I_segment a_s = -τ + I (a_d - a_s)
//
// without contacts. Box2D solves the left sides with ±τ; the terms with I on the right are applied as torques. They
// are computed from the last step's accelerations and filtered: each step corrects a share 1 / (1 + g), g = Σ I /
// I_segment, of their error. So they settle to the solution of the equations, also where I exceeds I_segment.
template <typename Step>
void SideViewCar::turn_rotors(const Step& step) {
  for (Pair& pair : pairs_) {
    b2Body& segment = *pair.joint->GetBodyA();
    pair.disc->ApplyTorque(to_torque(pair.on_disc_n_m), true);
    segment.ApplyTorque(to_torque(pair.on_segment_n_m), true);
    pair.start_segment_rad_s = segment.GetAngularVelocity();
  }
  step();
  for (Pair& pair : pairs_) {
    const double segment_rad_s2 = (pair.joint->GetBodyA()->GetAngularVelocity() - pair.start_segment_rad_s) / step_s_;
    const double joint_rad_s2 = (pair.joint->GetJointSpeed() + pair.start_rad_s) / step_s_;
    pair.on_disc_n_m += pair.settling * (pair.rotors_kg_m2 * segment_rad_s2 - pair.on_disc_n_m);
    pair.on_segment_n_m += pair.settling * (pair.rotors_kg_m2 * joint_rad_s2 - pair.on_segment_n_m);
  }
}

// Drives every hinge's joint with its flexure's torque at the end of the step, -k (angle + step · rate) - c · rate:
// like a servo's torque, it falls linearly with the rate, to 0 at bend / slope.
void SideViewCar::bend_hinges() {
  for (std::size_t j = 0; j < hinges_.size(); ++j) {
    const HingeSpec& spec = body_.hinges[j];
    const double slope = spec.damping_n_m_s_rad + step_s_ * spec.stiffness_n_m_rad;
    if (slope == 0) continue;
    const double bend_n_m = -spec.stiffness_n_m_rad * hinge_rad(j);
    const double rate_without_torque_rad_s = bend_n_m / slope;
    drive(*hinges_[j], bend_n_m - slope * static_cast<double>(hinges_[j]->GetJointSpeed()), rate_without_torque_rad_s);
  }
}

// Adds one step's work at the wheels (torque times the rate in the middle of the step) and energy from the battery.
// The joint's torque is divided between its two servos as their torques at the start of the step.
void SideViewCar::count_energy() {
  for (const Pair& pair : pairs_) {
    const double middle_rad_s = 0.5 * (pair.start_rad_s - static_cast<double>(pair.joint->GetJointSpeed()));
    const double given_n_m = -pair.joint->GetMotorTorque(static_cast<float>(options_.rate_hz)) / kUnits2;
    state_.motor_work_j += given_n_m * middle_rad_s * step_s_;
    double sum_n_m = 0;
    for (const Pair::Driven& one : pair.wheels) sum_n_m += one.torque_n_m;
    const double share = sum_n_m == 0 ? 0 : given_n_m / sum_n_m;
    for (const Pair::Driven& one : pair.wheels) {
      state_.consumed_energy_j +=
          supply_.draw(servo_current_a(one.wheel->servo, one.servo, share * one.torque_n_m)) * step_s_;
    }
  }
  supply_.end_step();
}

// Reads the main segment's pose and speed from Box2D. Heading and place across never change in the side view.
void SideViewCar::update_state() {
  const b2Body& main = *segments_[main_];
  const b2Rot& turn = main.GetTransform().q;
  const Vec3 at = ground_.to_world(to_metres(main.GetPosition().x), 0);
  state_.x_m = at.x;
  state_.y_m = at.y;
  state_.z_m = to_metres(main.GetPosition().y);
  state_.pitch_rad = arc_sine(std::clamp(static_cast<double>(turn.s), -1.0, 1.0));
  state_.up = turn.c;
  state_.speed_m_s = to_metres(main.GetLinearVelocityFromLocalPoint(b2Vec2_zero).x);
}

// Box2D calls this for every contact of a step: sets its friction, the part's grip times the ground's friction there.
void SideViewCar::PreSolve(b2Contact* contact, const b2Manifold*) {
  const double *a = contact->GetFixtureA()->GetUserData().grip, *b = contact->GetFixtureB()->GetUserData().grip;
  const double grip = a != nullptr ? *a : *b;
  double friction = scene_.friction;
  if (terrain_.has_patches()) {
    b2WorldManifold manifold;
    contact->GetWorldManifold(&manifold);
    friction = friction_at(to_metres(manifold.points[0].x));
  }
  contact->SetFriction(static_cast<float>(grip * friction));
}

// Returns the ground's friction at x_m in the side view: the mean of those below the left and the right wheels.
double SideViewCar::friction_at(double x_m) const {
  double sum = 0;
  for (const double side : {-0.5, 0.5}) {
    const Vec3 at = ground_.to_world(x_m, side * body_.track_m);
    sum += terrain_.friction(at.x, at.y, scene_.friction);
  }
  return 0.5 * sum;
}

double SideViewCar::hinge_rad(std::size_t hinge) const { return hinges_[hinge]->GetJointAngle(); }

const SideViewCar::Pair& SideViewCar::pair_of(std::size_t wheel) const {
  return *std::find_if(pairs_.begin(), pairs_.end(), [&](const Pair& pair) {
    return pair.wheels[0].wheel == &body_.wheels[wheel] || pair.wheels[1].wheel == &body_.wheels[wheel];
  });
}

double SideViewCar::wheel_speed_rad_s(std::size_t wheel) const { return -pair_of(wheel).joint->GetJointSpeed(); }

double SideViewCar::pair_load_n(std::size_t wheel) const {
  double impulse = 0;
  for (const b2ContactEdge* edge = pair_of(wheel).disc->GetContactList(); edge != nullptr; edge = edge->next) {
    const b2Manifold& manifold = *edge->contact->GetManifold();
    if (!edge->contact->IsTouching()) continue;
    for (int32 i = 0; i < manifold.pointCount; ++i) impulse += manifold.points[i].normalImpulse;
  }
  return to_metres(impulse) / step_s_;
}

double SideViewCar::mechanical_energy_j() const {
  double energy_j = 0;
  for (const b2Body* one = world_.GetBodyList(); one != nullptr; one = one->GetNext()) {
    energy_j += kinetic_j(*one) + one->GetMass() * kGravity_m_s2 * to_metres(one->GetWorldCenter().y);
  }
  for (std::size_t j = 0; j < hinges_.size(); ++j) {
    energy_j += 0.5 * body_.hinges[j].stiffness_n_m_rad * hinge_rad(j) * hinge_rad(j);
  }
  return energy_j;
}

bool SideViewCar::finite() const {
  return std::isfinite(state_.x_m) && std::isfinite(state_.z_m) && std::isfinite(state_.up) &&
         std::isfinite(state_.speed_m_s);
}

}  // namespace foldcar
