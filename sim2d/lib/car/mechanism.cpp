#include "mechanism.h"

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

// How the chassis is divided: each frame carries a quarter of its mass and a twentieth of its pitch inertia.
// The split changes nothing rigid (the frames cannot pitch against the chassis); it sets how much of the
// roll inertia stands in the frames, and keeps the mass ratios of the joints mild.
constexpr double kFrameMassShare = 0.25;
constexpr double kFramePitchShare = 0.05;
// Below this the flywheel is too light for its gears to be solved in a few iterations.
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
  // Box2D takes the geometric mean of both sides; the terrain has 1, so the square gives the coefficient.
  definition.friction = static_cast<float>(coefficient * coefficient);
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

void add_belly(b2Body& chassis, const BodySpec& body, double friction) {
  const ChassisSpec& spec = body.chassis;
  const double skin_m = std::min({kPolygonSkin_m, 0.25 * spec.length_m, 0.25 * spec.height_m});
  b2PolygonShape box;
  box.SetAsBox(to_units(0.5 * spec.length_m - skin_m), to_units(0.5 * spec.height_m - skin_m),
               to_units(-spec.com_x_m, spec.center_z_m - spec.com_z_m), 0);
  const b2FixtureDef fixture =
      contact_fixture(box, friction * spec.grip, category::kBelly, category::kBellyGround);
  chassis.CreateFixture(&fixture);
}

}  // namespace

CarConstants::CarConstants(const BodySpec& body) {
  const ChassisSpec& chassis = body.chassis;
  const double half_track_m = 0.5 * body.track_m;
  double wheels_mass_kg = 0, wheels_yaw_kg_m2 = 0, wheels_own_kg_m2 = 0, radius_sum_m = 0;
  tyre_width_m = 0;
  reach_m = 0.5 * chassis.length_m;
  for (const WheelSpec& wheel : body.wheels) {
    wheels_mass_kg += wheel.mass_kg;
    wheels_yaw_kg_m2 += wheel.mass_kg * (wheel.x_m * wheel.x_m + half_track_m * half_track_m);
    wheels_own_kg_m2 += 0.25 * wheel.mass_kg * wheel.radius_m * wheel.radius_m;  // a disc about its diameter
    radius_sum_m += wheel.radius_m;
    tyre_width_m = std::max(tyre_width_m, wheel.width_m);
    reach_m = std::max(reach_m, std::abs(wheel.x_m) + wheel.radius_m);
  }
  mass_kg = chassis.mass_kg + wheels_mass_kg;
  wheel_radius_m = radius_sum_m / static_cast<double>(body.wheels.size());
  com_height_m = wheel_radius_m + chassis.com_z_m * chassis.mass_kg / mass_kg;
  yaw_inertia_kg_m2 = chassis.yaw_inertia_kg_m2 + wheels_yaw_kg_m2 + wheels_own_kg_m2;
  const double in_frames_kg_m2 = 2 * kFrameMassShare * chassis.mass_kg * half_track_m * half_track_m;
  flywheel_inertia_kg_m2 =
      std::max(kLeastFlywheel_kg_m2, chassis.roll_inertia_kg_m2 + wheels_own_kg_m2 +
                                         mass_kg * com_height_m * com_height_m - in_frames_kg_m2);
}

double track_mass_kg(double yaw_inertia_kg_m2, double track_m) {
  return 2 * yaw_inertia_kg_m2 / (track_m * track_m);
}

Mechanism build_mechanism(b2World& world, const BodySpec& body, const CarConstants& constants, double friction,
                          double axle_z_m, double q) {
  const ChassisSpec& spec = body.chassis;
  const double com_z_m = axle_z_m + spec.com_z_m;
  Mechanism car;
  b2Body* ground = add_body(world, b2_staticBody, 0, 0, 0);
  car.belly_ground = add_body(world, b2_staticBody, 0, 0, 0);

  car.chassis = add_body(world, b2_dynamicBody, spec.com_x_m, com_z_m, 1);
  add_belly(*car.chassis, body, friction);
  set_mass(*car.chassis, (1 - 2 * kFrameMassShare) * spec.mass_kg,
           (1 - 2 * kFramePitchShare) * spec.pitch_inertia_kg_m2);

  car.roll = add_body(world, b2_dynamicBody, 0, 1, 0);
  car.roll->SetTransform(car.roll->GetPosition(), static_cast<float>(q));
  set_mass(*car.roll, 1, constants.flywheel_inertia_kg_m2);
  b2RevoluteJointDef roll_axis;
  roll_axis.bodyA = ground;
  roll_axis.bodyB = car.roll;
  roll_axis.localAnchorA = car.roll->GetPosition();
  b2Joint* roll_joint = world.CreateJoint(&roll_axis);

  for (int k = 0; k < 2; ++k) {
    const double sign = k == 0 ? 1 : -1;
    car.frame[k] =
        add_body(world, b2_dynamicBody, spec.com_x_m, com_z_m + sign * 0.5 * body.track_m * q, 1);
    set_mass(*car.frame[k], kFrameMassShare * spec.mass_kg, kFramePitchShare * spec.pitch_inertia_kg_m2);
    b2PrismaticJoint* slide =
        add_slide(world, car.chassis, car.frame[k], b2Vec2(0, 1), b2Vec2_zero, false);
    add_gear(world, roll_joint, slide, -sign * 2 / (body.track_m * kUnitsPerMetre));

    car.track[k] = add_body(world, b2_dynamicBody, 0, 0, 0);
    set_mass(*car.track[k], track_mass_kg(constants.yaw_inertia_kg_m2, body.track_m), 1);
    car.track_slide[k] = add_slide(world, ground, car.track[k], b2Vec2(1, 0), b2Vec2_zero, true);
  }
  add_gear(world, car.track_slide[0], car.track_slide[1], 1);

  for (const WheelSpec& wheel : body.wheels) {
    const int k = static_cast<int>(wheel.side);
    b2Body* frame = car.frame[k];
    const b2Vec2 anchor = to_units(wheel.x_m - spec.com_x_m, -spec.com_z_m);
    const b2Vec2 center = frame->GetPosition() + anchor;
    b2Body* disc = add_body(world, b2_dynamicBody, to_metres(center.x), to_metres(center.y), 1);
    b2CircleShape circle;
    circle.m_radius = to_units(wheel.radius_m - kWheelSkin_m);
    const b2FixtureDef fixture =
        contact_fixture(circle, friction * wheel.grip, category::kWheel[k], category::kTrack[k]);
    disc->CreateFixture(&fixture);
    // The rotor turns in the chassis, geared to the wheel: its inertia at the shaft is the wheel's to drive.
    set_mass(*disc, wheel.mass_kg,
             0.5 * wheel.mass_kg * wheel.radius_m * wheel.radius_m + wheel.servo.rotor_inertia_kg_m2);
    b2RevoluteJointDef axle;
    axle.bodyA = frame;
    axle.bodyB = disc;
    axle.localAnchorA = anchor;
    axle.enableMotor = true;
    axle.maxMotorTorque = 0;
    car.wheel.push_back(disc);
    car.wheel_motor.push_back(static_cast<b2RevoluteJoint*>(world.CreateJoint(&axle)));
  }
  return car;
}

}  // namespace foldcar
