#include "mechanism.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace foldcar {
namespace {

// Each frame has a tenth of its segment's mass and pitch inertia. The segment's sums do not depend on these shares, for
// the frames cannot pitch against the chassis; they decide how much of the roll inertia the frames represent.
constexpr double kFrameMassShare = 0.1;
constexpr double kFramePitchShare = 0.1;
// A lighter flywheel needs more iterations than the step has for its gear joints to converge.
constexpr double kLeastFlywheel_kg_m2 = 2e-5;

b2Body* add_body(b2World& world, b2BodyType type, double x_m, double z_m, double gravity_scale) {
  b2BodyDef definition;
  definition.type = type;
  definition.position = to_units(x_m, z_m);
  definition.gravityScale = static_cast<float>(gravity_scale);
  definition.allowSleep = false;
  return world.CreateBody(&definition);
}

b2FixtureDef contact_fixture(const b2Shape& shape, double coefficient, std::uint16_t category,
                             std::uint16_t meets) {
  b2FixtureDef definition;
  definition.shape = &shape;
  definition.density = 0;
  definition.friction = fixture_friction(coefficient);
  definition.restitution = 0;
  definition.filter.categoryBits = category;
  definition.filter.maskBits = meets;
  return definition;
}

b2GearJoint* add_gear(b2World& world, b2Joint* first, b2Joint* second, double ratio) {
  b2GearJointDef definition;
  definition.joint1 = first;
  definition.joint2 = second;
  definition.bodyA = first->GetBodyB();
  definition.bodyB = second->GetBodyB();
  definition.ratio = static_cast<float>(ratio);
  return static_cast<b2GearJoint*>(world.CreateJoint(&definition));
}

b2PrismaticJoint* add_slide(b2World& world, b2Body* a, b2Body* b, b2Vec2 axis, b2Vec2 anchor_b, bool motor) {
  b2PrismaticJointDef definition;
  definition.bodyA = a;
  definition.bodyB = b;
  definition.localAxisA = axis;
  definition.localAnchorB = anchor_b;
  definition.enableMotor = motor;
  return static_cast<b2PrismaticJoint*>(world.CreateJoint(&definition));
}

void add_belly(b2Body& chassis, const SegmentSpec& spec, double friction) {
  b2PolygonShape box;
  box.SetAsBox(to_units(0.5 * spec.length_m - kPolygonSkin_m), to_units(0.5 * spec.height_m - kPolygonSkin_m),
               to_units(spec.x_m - spec.com_x_m, spec.center_z_m - spec.com_z_m), 0);
  const b2FixtureDef fixture =
      contact_fixture(box, friction * spec.grip, category::kBelly, category::kBellyGround);
  chassis.CreateFixture(&fixture);
}

b2Body* add_chassis(b2World& world, const SegmentSpec& spec, double friction, double axle_z_m) {
  b2Body* chassis = add_body(world, b2_dynamicBody, spec.com_x_m, axle_z_m + spec.com_z_m, 1);
  add_belly(*chassis, spec, friction);
  set_mass(*chassis, (1 - 2 * kFrameMassShare) * spec.mass_kg,
           (1 - 2 * kFramePitchShare) * spec.pitch_inertia_kg_m2);
  return chassis;
}

b2Joint* add_roll_flywheel(b2World& world, Mechanism& car, b2Body* ground, double inertia_kg_m2, double q) {
  car.roll = add_body(world, b2_dynamicBody, 0, 1, 0);
  car.roll->SetTransform(car.roll->GetPosition(), static_cast<float>(q));
  set_mass(*car.roll, 1, inertia_kg_m2);
  b2RevoluteJointDef axis;
  axis.bodyA = ground;
  axis.bodyB = car.roll;
  axis.localAnchorA = car.roll->GetPosition();
  return world.CreateJoint(&axis);
}

// The frame of the left (sign = +1) or right (-1) side, displaced along z by roll and geared to the flywheel.
b2Body* add_frame(b2World& world, b2Body* chassis, const SegmentSpec& spec, b2Joint* roll_joint, double track_m,
                  double sign, double axle_z_m, double q) {
  const double z_m = axle_z_m + spec.com_z_m + sign * 0.5 * track_m * q;
  b2Body* frame = add_body(world, b2_dynamicBody, spec.com_x_m, z_m, 1);
  set_mass(*frame, kFrameMassShare * spec.mass_kg, kFramePitchShare * spec.pitch_inertia_kg_m2);
  b2PrismaticJoint* slide = add_slide(world, chassis, frame, b2Vec2(0, 1), b2Vec2_zero, false);
  add_gear(world, roll_joint, slide, -sign * 2 / (track_m * kUnitsPerMetre));
  return frame;
}

void add_wheel(b2World& world, Mechanism& car, const BodySpec& body, const WheelSpec& wheel, double friction) {
  const int k = static_cast<int>(wheel.side);
  const std::size_t j = static_cast<std::size_t>(wheel.segment);
  b2Body* frame = car.segments[j].frame[k];
  const SegmentSpec& spec = body.segments[j];
  const b2Vec2 anchor = to_units(wheel.x_m - spec.com_x_m, -spec.com_z_m);
  const b2Vec2 center = frame->GetPosition() + anchor;
  b2Body* disc = add_body(world, b2_dynamicBody, to_metres(center.x), to_metres(center.y), 1);
  b2CircleShape circle;
  circle.m_radius = to_units(wheel.radius_m - kWheelSkin_m);
  // Only the tread is eccentric. The imbalance of a wheel of a few grams, one millimetre off its axle, is negligible.
  circle.m_p = to_units(wheel.eccentricity_m * std::cos(wheel.eccentricity_phase_rad),
                        wheel.eccentricity_m * std::sin(wheel.eccentricity_phase_rad));
  const b2FixtureDef fixture =
      contact_fixture(circle, friction * wheel.grip, category::kWheel[k], category::kTrack[k]);
  disc->CreateFixture(&fixture);
  // The rotor is geared to the wheel: its inertia at the output shaft adds to the wheel's.
  set_mass(*disc, wheel.mass_kg,
           0.5 * wheel.mass_kg * wheel.radius_m * wheel.radius_m + wheel.servo.rotor_inertia_kg_m2);
  if (car.rotors_in_frames) {
    set_mass(*frame, frame->GetMass(), frame->GetInertia() / kTorqueScale + wheel.servo.rotor_inertia_kg_m2);
  }
  b2RevoluteJointDef axle;
  axle.bodyA = frame;
  axle.bodyB = disc;
  axle.localAnchorA = anchor;
  axle.enableMotor = true;
  axle.maxMotorTorque = 0;
  car.wheel.push_back(disc);
  car.wheel_motor.push_back(static_cast<b2RevoluteJoint*>(world.CreateJoint(&axle)));
}

// Two joints at one point: a revolute joint for the limits and a soft weld joint for the flexure. Box2D integrates the
// weld's spring and damper implicitly, which is stable at any stiffness and adds a damping of stiffness times step.
void add_hinge(b2World& world, Mechanism& car, const HingeSpec& spec, double axle_z_m) {
  const std::size_t j = car.hinge.size();
  b2Body* front = car.segments[j].chassis;
  b2Body* rear = car.segments[j + 1].chassis;
  const b2Vec2 place = to_units(spec.x_m, axle_z_m + spec.z_m);
  b2WeldJointDef flexure;
  flexure.Initialize(rear, front, place);
  flexure.stiffness = to_torque_units(spec.stiffness_n_m_rad);
  flexure.damping = to_torque_units(spec.damping_n_m_s_rad);
  world.CreateJoint(&flexure);
  b2RevoluteJointDef limits;
  limits.Initialize(rear, front, place);
  limits.enableLimit = true;
  limits.lowerAngle = static_cast<float>(spec.min_rad);
  limits.upperAngle = static_cast<float>(spec.max_rad);
  car.hinge.push_back(static_cast<b2RevoluteJoint*>(world.CreateJoint(&limits)));
}

// All segments as one rigid body: mass, centre of mass, roll and yaw inertia by the parallel axis theorem. The other
// members are those of the first segment.
SegmentSpec combined(const std::vector<SegmentSpec>& segments) {
  const SegmentSpec& first = segments.front();
  SegmentSpec one = first;
  double moment_x = 0, moment_y = 0, moment_z = 0;
  for (std::size_t j = 1; j < segments.size(); ++j) {
    const SegmentSpec& segment = segments[j];
    one.mass_kg += segment.mass_kg;
    one.roll_inertia_kg_m2 += segment.roll_inertia_kg_m2;
    one.yaw_inertia_kg_m2 += segment.yaw_inertia_kg_m2;
    moment_x += segment.mass_kg * (segment.com_x_m - first.com_x_m);
    moment_y += segment.mass_kg * (segment.com_y_m - first.com_y_m);
    moment_z += segment.mass_kg * (segment.com_z_m - first.com_z_m);
  }
  one.com_x_m += moment_x / one.mass_kg;
  one.com_y_m += moment_y / one.mass_kg;
  one.com_z_m += moment_z / one.mass_kg;
  for (const SegmentSpec& segment : segments) {
    const double dx = segment.com_x_m - one.com_x_m, dy = segment.com_y_m - one.com_y_m,
                 dz = segment.com_z_m - one.com_z_m;
    one.roll_inertia_kg_m2 += segment.mass_kg * (dy * dy + dz * dz);
    one.yaw_inertia_kg_m2 += segment.mass_kg * (dx * dx + dy * dy);
  }
  return one;
}

}  // namespace

CarConstants::CarConstants(const BodySpec& body) {
  const SegmentSpec chassis = combined(body.segments);
  const double half_track_m = 0.5 * body.track_m;
  const double reference_x_m = body.segments[main_segment(body)].com_x_m;
  double wheels_mass_kg = 0, wheels_moment_kg_m = 0, wheels_own_kg_m2 = 0, radius_sum_m = 0;
  tyre_width_m = reach_m = 0;
  for (const WheelSpec& wheel : body.wheels) {
    wheels_mass_kg += wheel.mass_kg;
    wheels_moment_kg_m += wheel.mass_kg * wheel.x_m;
    wheels_own_kg_m2 += 0.25 * wheel.mass_kg * wheel.radius_m * wheel.radius_m;  // a disc about its diameter
    radius_sum_m += wheel.radius_m;
    tyre_width_m = std::max(tyre_width_m, wheel.width_m);
    reach_m = std::max(reach_m, std::abs(wheel.x_m - reference_x_m) + wheel.radius_m + wheel.eccentricity_m);
  }
  mass_kg = chassis.mass_kg + wheels_mass_kg;
  wheel_radius_m = radius_sum_m / static_cast<double>(body.wheels.size());
  com_x_m = (chassis.mass_kg * chassis.com_x_m + wheels_moment_kg_m) / mass_kg;
  com_height_m = wheel_radius_m + chassis.com_z_m * chassis.mass_kg / mass_kg;
  side_moment_kg_m = chassis.mass_kg * chassis.com_y_m;
  double wheels_yaw_kg_m2 = 0;
  for (const WheelSpec& wheel : body.wheels) {
    const double dx = wheel.x_m - com_x_m;
    wheels_yaw_kg_m2 += wheel.mass_kg * (dx * dx + half_track_m * half_track_m);
  }
  const double chassis_dx = chassis.com_x_m - com_x_m;
  yaw_inertia_kg_m2 = chassis.yaw_inertia_kg_m2 + chassis.mass_kg * chassis_dx * chassis_dx + wheels_yaw_kg_m2 +
                      wheels_own_kg_m2;
  const double wheels_roll_kg_m2 = wheels_mass_kg * half_track_m * half_track_m;
  roll_inertia_kg_m2 = chassis.roll_inertia_kg_m2 + wheels_own_kg_m2 + wheels_roll_kg_m2;
  frames_roll_kg_m2 = wheels_roll_kg_m2 + 2 * kFrameMassShare * chassis.mass_kg * half_track_m * half_track_m;
  belly_width_m = 0;
  belly_clearance_m = wheel_radius_m;
  for (const SegmentSpec& segment : body.segments) {
    belly_width_m = std::max(belly_width_m, segment.width_m);
    belly_clearance_m =
        std::min(belly_clearance_m, wheel_radius_m + segment.center_z_m - 0.5 * segment.height_m);
    reach_m = std::max(reach_m, std::abs(segment.x_m - reference_x_m) + 0.5 * segment.length_m);
  }
}

double plane_roll_inertia_kg_m2(const BodySpec& body, const CarConstants& constants, double friction) {
  const double lever_m = 0.5 * body.track_m, height_m = constants.com_height_m;
  const double holding_kg_m2 = constants.roll_inertia_kg_m2 + constants.mass_kg * height_m * height_m;
  // Sliding contacts: an impact J under one side comes with the lateral impulse μ J at the height of the contacts,
  // which shortens the lever of J from t to t - μ h.
  const double shortened_m = lever_m - friction * height_m;
  const double sliding_kg_m2 =
      shortened_m > 0 ? constants.roll_inertia_kg_m2 * lever_m / shortened_m : std::numeric_limits<double>::infinity();
  return std::max(std::min(holding_kg_m2, sliding_kg_m2), constants.frames_roll_kg_m2 + kLeastFlywheel_kg_m2);
}

double track_mass_kg(double yaw_inertia_kg_m2, double track_m) {
  return 2 * yaw_inertia_kg_m2 / (track_m * track_m);
}

Mechanism build_mechanism(b2World& world, const BodySpec& body, const CarConstants& constants, double friction,
                          double axle_z_m, double q) {
  Mechanism car;
  car.rotors_in_frames = !body.hinges.empty();
  b2Body* ground = add_body(world, b2_staticBody, 0, 0, 0);
  car.belly_ground = add_body(world, b2_staticBody, 0, 0, 0);
  for (const SegmentSpec& segment : body.segments) {
    car.segments.push_back({add_chassis(world, segment, friction, axle_z_m), {}});
  }
  car.chassis = car.segments[main_segment(body)].chassis;
  b2Joint* roll_joint = add_roll_flywheel(
      world, car, ground, plane_roll_inertia_kg_m2(body, constants, friction) - constants.frames_roll_kg_m2, q);
  for (int k = 0; k < 2; ++k) {
    const double sign = k == 0 ? 1 : -1;
    for (std::size_t j = 0; j < body.segments.size(); ++j) {
      MechanismSegment& segment = car.segments[j];
      segment.frame[k] = add_frame(world, segment.chassis, body.segments[j], roll_joint, body.track_m, sign,
                                   axle_z_m, q);
    }
    car.track[k] = add_body(world, b2_dynamicBody, 0, 0, 0);
    // The slide's angular constraint would not converge for wheels far along the track.
    car.track[k]->SetFixedRotation(true);
    set_mass(*car.track[k], track_mass_kg(constants.yaw_inertia_kg_m2, body.track_m), 1);
    car.track_slide[k] = add_slide(world, ground, car.track[k], b2Vec2(1, 0), b2Vec2_zero, true);
  }
  add_gear(world, car.track_slide[0], car.track_slide[1], 1);
  for (const WheelSpec& wheel : body.wheels) add_wheel(world, car, body, wheel, friction);
  for (const HingeSpec& hinge : body.hinges) add_hinge(world, car, hinge, axle_z_m);
  return car;
}

}  // namespace foldcar
