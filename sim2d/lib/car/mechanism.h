// The twin-track car as Box2D bodies and joints in one vertical plane.
//
//   segment   a box with its belly and four fifths of its mass, and for each side a frame that slides along the box' z
//             and carries that side's wheels; segments hang together in hinges
//   wheel[i]  circles on revolute motors, one a wheel
//   roll      a flywheel, geared to all frames: its angle is q = sin(roll), its inertia what the frames lack.
//             The car is stiff against twist: all segments roll alike
//   track[k]  the terrain under the left and right wheels, free to slide along x against each other: their
//             difference is yaw, their mass the yaw inertia
//   belly_ground  the terrain under the bellies, fixed
//
// Positions are relative to where the car is put down (s = 0); x forward, y up, angles nose up.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "body_spec.h"
#include "plane.h"

namespace foldcar {

struct MechanismSegment {
  b2Body* chassis = nullptr;
  std::array<b2Body*, 2> frame{};
};

struct Mechanism {
  std::vector<MechanismSegment> segments;  // front to back
  std::vector<b2RevoluteJoint*> hinge;     // hinge[j] joins segments j and j + 1
  // A rotor geared to a wheel resists its frame's pitching too. On a long rigid car that may lag a step; a segment
  // of a hinged one can weigh less than its rotors, and would be shaken to pieces: there they stand in its inertia.
  bool rotors_in_frames = false;
  b2Body* chassis = nullptr;               // the main segment's, whose centre of mass is followed
  std::array<b2Body*, 2> track{};
  b2Body* belly_ground = nullptr;
  b2Body* roll = nullptr;
  std::vector<b2Body*> wheel;
  std::vector<b2RevoluteJoint*> wheel_motor;
  std::array<b2PrismaticJoint*, 2> track_slide{};
};

// Collision pairs: each side's wheels meet that side's track, the belly its own ground, nothing else.
namespace category {
constexpr std::uint16_t kTrack[2] = {1, 2};
constexpr std::uint16_t kBellyGround = 4;
constexpr std::uint16_t kWheel[2] = {8, 16};
constexpr std::uint16_t kBelly = 32;
}  // namespace category

// Quantities of the whole car that the terms need, from its parts, hinges flat.
struct CarConstants {
  explicit CarConstants(const BodySpec& body);
  double mass_kg;
  double com_x_m;
  double com_height_m;         // over the contacts, car level
  double side_moment_kg_m;     // sum of masses times how far left of the middle they are
  double tyre_width_m;         // the widest
  double wheel_radius_m;       // the mean
  double yaw_inertia_kg_m2;    // about the vertical through the centre of mass
  double roll_inertia_kg_m2;   // about the line ahead through the centre of mass
  double frames_roll_kg_m2;    // of it, what the mechanism's frames and wheels stand for
  double belly_width_m;        // the widest
  double belly_clearance_m;    // the lowest belly over the contacts
  double reach_m;              // farthest point of the car from the main segment's centre of mass, along x
};

// Builds the car in world with its axle line at height axle_z_m, rolled by asin(q).
Mechanism build_mechanism(b2World& world, const BodySpec& body, const CarConstants& constants, double friction,
                          double axle_z_m, double q);

// What the mechanism takes for roll inertia: the car's own and that of its mass, which rolling about the contacts drags
// aside - all of it if they hold in an impact under one side, as much as friction can move if they slide.
double plane_roll_inertia_kg_m2(const BodySpec& body, const CarConstants& constants, double friction);

// The mass that makes the sliding tracks as hard to turn as a car of that yaw inertia.
double track_mass_kg(double yaw_inertia_kg_m2, double track_m);

}  // namespace foldcar
