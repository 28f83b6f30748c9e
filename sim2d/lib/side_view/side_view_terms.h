// Couples on roll that a side view does not have, as generalised forces on q = sin(roll): a couple divided by
// cos(roll).
//
// Signs: roll is positive with the left side up, lateral distances to the left. SI units.
#pragma once

namespace foldcar {

// Largest |q| used in tan(roll); a car that far over has tipped.
constexpr double kMaxSinRoll = 0.95;

// q, limited to ±kMaxSinRoll; the tangent and the cosine of the roll angle of that q.
double sin_roll_limited(double q);
double tan_roll(double q);
double cos_roll(double q);

// First moments of the vertical contact forces, summed over the contacts (N·m): force times
struct CarriedLoad {
  double height_n_m = 0;  // height of the centre of mass over the contact, car level
  double middle_n_m = 0;  // distance of the contact to the left of the middle of its side's tyres, or of the belly
  double width_n_m = 0;   // width of the tyre
};

// Couple (N·m) of the contact forces; zero in the air. From |q| = 0.02 a tyre stands on its lower edge, so the weight
// overturns the car beyond a roll of atan((track + tyre width) / (2 height)).
double load_roll_couple_n_m(const CarriedLoad& load, double q);

// Couple (N·m) of the weight of masses beside the middle; side_moment_kg_m is the sum of mass times distance to the
// left. It is constant: the lever shrinks with cos(roll), by which the couple is divided.
double offset_roll_couple_n_m(double side_moment_kg_m);

}  // namespace foldcar
