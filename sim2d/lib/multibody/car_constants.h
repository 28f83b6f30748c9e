// Sizes, mass and inertias of a whole car with its hinges flat.
#pragma once

#include "body_spec.h"

namespace foldcar {

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
  double belly_width_m;        // the largest
  double belly_clearance_m;    // of the lowest belly over the contacts
  double reach_m;              // largest distance along x of a point of the car from the main segment's centre of mass
};

}  // namespace foldcar
