// Sine, cosine, exponential, arc tangent and hypotenuse of IEEE additions, multiplications, divisions and roots alone:
// the same bits with every C library, compiler and processor that does arithmetic in binary64 without fusing.
//
// A program that links this library has them under the C library's names too (sin, cosf, atan2, ...), which Box2D and
// the firmware call; elementary_functions.cpp lists them. Errors are at most kElementaryError_ulp units in the last
// place, of single-precision results 0.501.
#pragma once

namespace foldcar {

inline constexpr double kElementaryError_ulp = 3;
// Beyond this angle (rad) sine and cosine are those of the angle's remainder by 2 pi rounded to a double.
inline constexpr double kExactReduction_rad = 1e6;

double sine(double angle_rad);
double cosine(double angle_rad);
double exponential(double x);
double arc_tangent(double y, double x);
double hypotenuse(double x, double y);

}  // namespace foldcar
