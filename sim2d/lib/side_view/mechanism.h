// The twin-track car as Box2D bodies and joints in one vertical plane.
//
//   segment   a chassis (box with the belly and four fifths of the segment's mass) and for each side a frame that
//             slides along the chassis' z axis and carries that side's wheels; segments are joined by hinges
//   wheel[i]  a circle on a revolute joint with a motor
//   roll      a flywheel geared to all frames: its angle is q = sin(roll), its inertia the part of the roll inertia
//             that the frames do not represent. The car is rigid in torsion: all segments have the same roll
//   track[k]  the terrain under the left and the right wheels, two bodies that slide along x in opposite directions:
//             the difference of their positions is track width times heading, their mass represents the yaw inertia
//   belly_ground  the terrain under the bellies, fixed
//
// Positions are relative to where the car is put down (s = 0); x forward, y up, angles positive nose up.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "body_spec.h"
#include "plane.h"

namespace foldcar {

// The bodies of one segment; frame[0] is the left one.
struct MechanismSegment {
  b2Body* chassis = nullptr;
  std::array<b2Body*, 2> frame{};
};

// Every body and joint of a car that is read or driven; the world owns them.
struct Mechanism {
  std::vector<MechanismSegment> segments;  // front to back
  std::vector<b2RevoluteJoint*> hinge;     // hinge[j] joins segments j and j + 1
  // Whether the frames' moments of inertia include the servo rotors geared to their wheels. Otherwise the rotor's
  // reaction is applied as a torque, one step late. That is unstable where a segment has less inertia than its rotors,
  // which a hinged car can have.
  bool rotors_in_frames = false;
  b2Body* chassis = nullptr;  // of the main segment, whose position is the car's position in the plane
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

// Constants of the whole car, from its parts with the hinges flat.
struct CarConstants {
  explicit CarConstants(const BodySpec& body);
  double mass_kg;
  double com_x_m;              // centre of mass ahead of the car's origin
  double com_height_m;         // centre of mass over the contacts, car level
  double side_moment_kg_m;     // sum of mass times distance to the left of the middle
  double tyre_width_m;         // the largest
  double wheel_radius_m;       // the mean
  double yaw_inertia_kg_m2;    // about the vertical axis through the centre of mass
  double roll_inertia_kg_m2;   // about the forward axis through the centre of mass
  double frames_roll_kg_m2;    // the part of it that the mechanism's frames and wheels represent
  double belly_width_m;        // the largest
  double belly_clearance_m;    // of the lowest belly over the contacts
  double reach_m;              // largest distance along x of a point of the car from the main segment's centre of mass
};

// Builds the car in world with its axle line at height axle_z_m, rolled by asin(q).
Mechanism build_mechanism(b2World& world, const BodySpec& body, const CarConstants& constants, double friction,
                          double axle_z_m, double q);

// Roll inertia of the plane. An impact under one side rolls the car about the contacts of the other side, so it has to
// accelerate the centre of mass sideways too. The result is the smaller of two limits: I + m h² if friction holds the
// contacts, and I t / (t - μ h) with half the track t if they slide.
double plane_roll_inertia_kg_m2(const BodySpec& body, const CarConstants& constants, double friction);

// Mass of each track body so that the two together represent that yaw inertia: 2 I / track².
double track_mass_kg(double yaw_inertia_kg_m2, double track_m);

}  // namespace foldcar
