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

// Couple about the roll axis (N·m) of the weight of a car of mass_kg whose centre of mass stands com_height_m
// over the contacts. Tyres of width tyre_width_m move the support outwards by half their width once they
// lean (over 0.02 in q), so the weight overturns the car only beyond atan((track + tyre) / (2 height)).
double weight_roll_couple_n_m(double mass_kg, double com_height_m, double tyre_width_m, double q);

// Couple about the roll axis (N·m) of masses off the middle; side_moment_kg_m is positive for more on the left.
// Constant: q is the sine of roll, which their lever's shortening cancels.
double offset_roll_couple_n_m(double side_moment_kg_m);

// Couple about the roll axis (N·m) of turning at yaw_rate_rad_s while driving: outwards.
double turning_roll_couple_n_m(double mass_kg, double com_height_m, double speed_m_s, double yaw_rate_rad_s);

// Friction left for sliding sideways when drive_ratio of it (tangential force over its limit) is spent
// on driving; some is always left.
double friction_circle(double drive_ratio);

// Change of heading (rad) of a step in which the car's own yaw angle changes by d_yaw and its pitch by
// d_pitch, for a car that rolls (q) and pitches: the rates of the Euler angles.
double heading_step_rad(double d_yaw_rad, double d_pitch_rad, double pitch_rad, double q);

}  // namespace foldcar
