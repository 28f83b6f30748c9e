// What width adds to a side view, term by term: the couples and motions that a plane does not have.
//
// Signs: roll phi is positive with the left side up, q = sin(phi); yaw is positive to the left; pitch beta is
// positive nose up. SI units.
#pragma once

namespace foldcar {

constexpr double kGravity_m_s2 = 9.81;

// Largest |q| that is used in tan(phi): a car that far over has tipped.
constexpr double kMaxSinRoll = 0.95;

double sin_roll_limited(double q);
double tan_roll(double q);
double cos_roll(double q);

// What the ground carries, summed over all that stands on it: each share (N) times the height of the centre of mass over
// it, times how far left of its part of the car's middle it stands, and times the width of the tyre that stands on it.
struct CarriedLoad {
  double height_n_m = 0;
  double middle_n_m = 0;
  double width_n_m = 0;
};

// Couple about the roll axis (N·m) of load: of the weight at rest, none in the air. Tyres lean on the edge that is down
// once the car leans over 0.02 in q, so the weight overturns the car only beyond atan((track + tyre) / (2 height)).
double load_roll_couple_n_m(const CarriedLoad& load, double q);

// Couple about the roll axis (N·m) of masses off the middle; side_moment_kg_m is positive for more on the left.
// Constant: q is the sine of roll, which their lever's shortening cancels.
double offset_roll_couple_n_m(double side_moment_kg_m);

}  // namespace foldcar
