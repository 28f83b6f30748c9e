// Sine, cosine, exponential, arc functions and hypotenuse of IEEE additions, multiplications, divisions and roots alone:
// the same bits with every C library, compiler and processor that does arithmetic in binary64 without fusing.
//
// Firmware and simulator call these instead of the C library's functions. Errors are at most kElementaryError_ulp units in
// the last place.
#pragma once

namespace foldcar {

inline constexpr double kElementaryError_ulp = 3;
// Beyond this angle (rad) sine and cosine are those of the angle's remainder by 2 pi rounded to a double.
inline constexpr double kExactReduction_rad = 1e6;

// Adding and taking away 1.5 * 2^52 rounds to an integer.
inline constexpr double kRounder = 0x1.8p52;
// The first two parts of pi/2 have 33 bits, so that their multiples are exact.
inline constexpr double kQuartersPerRad = 0x1.45f306dc9c883p-1;
inline constexpr double kQuarterPart1_rad = 0x1.921fb544p+0, kQuarterPart2_rad = 0x1.0b4611a6p-34;
inline constexpr double kSmallAngle_rad = 1e-8;  // below it an angle is its own sine, with the sign of zero

struct SineCosine {
  double sine, cosine;
};

// Sine and cosine of an angle that is by so many quarter turns beyond the angle of sine s and cosine c.
inline SineCosine turned_by(int quarters, double s, double c) {
  const bool odd = quarters % 2 != 0;
  return {(quarters & 2) != 0 ? -(odd ? c : s) : (odd ? c : s), ((quarters + 1) & 2) != 0 ? -(odd ? s : c) : (odd ? s : c)};
}

double sine(double angle_rad);
double cosine(double angle_rad);
// Both for one reduction of the angle, with the bits of each alone.
SineCosine sine_and_cosine(double angle_rad);
double exponential(double x);
// Angles (rad) of -pi to pi, -pi/2 to pi/2 and 0 to pi; not a number where |x| > 1.
double arc_tangent(double y, double x);
double arc_sine(double x);
double arc_cosine(double x);
double hypotenuse(double x, double y);

}  // namespace foldcar
