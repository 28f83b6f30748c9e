#include "elementary_functions.h"

#include <cmath>
#include <limits>

namespace foldcar {
namespace {

constexpr double kHalfPi = 0x1.921fb54442d18p+0, kHalfPiRest = 0x1.1a62633145c07p-54;
constexpr double kEighthPi = 0x1.921fb54442d18p-2, kTanEighthPi = 0x1.a827999fcef32p-2;

// An angle as a number of quarter turns and a rest, which is the unrounded sum high + low (Cody and Waite's
// reduction).
struct Reduced {
  int quarters;
  double high, low;
};

Reduced reduced(double angle_rad) {
  constexpr double kPart3 = 0x1.3198a2e037073p-69;
  if (std::abs(angle_rad) > kExactReduction_rad) angle_rad = std::remainder(angle_rad, 4 * kHalfPi);
  const double quarters = (angle_rad * kQuartersPerRad + kRounder) - kRounder;
  const double rest = angle_rad - quarters * kQuarterPart1_rad;
  const double second = quarters * kQuarterPart2_rad, third = quarters * kPart3;
  const double without = rest - second;
  const double high = without - third;
  return {static_cast<int>(quarters), high, ((rest - without) - second) + ((without - high) - third)};
}

// Taylor series up to pi/4, where the first term left out is below 1e-19.
double sine_of(const Reduced& angle) {
  const double r = angle.high, z = r * r;
  const double series =
      -1 / 6.0 +
      z * (1 / 120.0 +
           z * (-1 / 5040.0 +
                z * (1 / 362880.0 +
                     z * (-1 / 39916800.0 + z * (1 / 6227020800.0 + z * (-1 / 1307674368000.0 + z / 355687428096000.0))))));
  return r + (r * z * series + angle.low * (1 - 0.5 * z));
}

double cosine_of(const Reduced& angle) {
  const double r = angle.high, z = r * r;
  const double series =
      1 / 24.0 +
      z * (-1 / 720.0 +
           z * (1 / 40320.0 +
                z * (-1 / 3628800.0 + z * (1 / 479001600.0 + z * (-1 / 87178291200.0 + z / 20922789888000.0)))));
  const double half = 0.5 * z, near = 1 - half;
  return near + (((1 - near) - half) + (z * z * series - r * angle.low));
}

// Sine of the angle plus so many quarter turns; with 1 the cosine.
double turned(const Reduced& angle, int quarters) {
  const int turn = (angle.quarters + quarters) & 3;
  const double value = turn % 2 == 0 ? sine_of(angle) : cosine_of(angle);
  return turn < 2 ? value : -value;
}

// Arc tangent of a ratio from 0 to 1: atan(ratio) = nearest + atan(u) with the nearest of 0, pi/8 and pi/4, and the
// series of atan(u), |u| < 0.199.
double first_octant(double ratio) {
  const int nearest = ratio < 0.19891236737965800 ? 0 : ratio < 0.66817863791929892 ? 1 : 2;
  const double tangent = nearest == 0 ? 0 : nearest == 1 ? kTanEighthPi : 1;
  const double u = (ratio - tangent) / (1 + ratio * tangent), z = u * u;
  double series = 0;
  for (int power = 23; power >= 3; power -= 2) series = z * ((power % 4 == 3 ? -1.0 : 1.0) / power + series);
  return nearest * kEighthPi + (u + u * series);
}

}  // namespace

double sine(double angle_rad) {
  if (!std::isfinite(angle_rad)) return angle_rad - angle_rad;
  if (std::abs(angle_rad) < kSmallAngle_rad) return angle_rad;
  return turned(reduced(angle_rad), 0);
}

double cosine(double angle_rad) {
  if (!std::isfinite(angle_rad)) return angle_rad - angle_rad;
  if (std::abs(angle_rad) < kSmallAngle_rad) return 1;
  return turned(reduced(angle_rad), 1);
}

SineCosine sine_and_cosine(double angle_rad) {
  if (!(std::abs(angle_rad) >= kSmallAngle_rad)) return {sine(angle_rad), cosine(angle_rad)};
  if (!std::isfinite(angle_rad)) return {angle_rad - angle_rad, angle_rad - angle_rad};
  const Reduced angle = reduced(angle_rad);
  return turned_by(angle.quarters, sine_of(angle), cosine_of(angle));
}

// exp(x) = 2^twos · exp(r) with |r| <= ln(2)/2, and the Taylor series of exp(r).
double exponential(double x) {
  constexpr double kLn2Part1 = 0x1.62e42fefa38p-1, kLn2Part2 = 0x1.ef35793c7673p-45;  // the first has 42 bits
  if (std::isnan(x)) return x;
  if (x > 709.8) return std::numeric_limits<double>::infinity();
  if (x < -746) return 0;
  const double twos = (x * 0x1.71547652b82fep+0 + kRounder) - kRounder;
  const double high = x - twos * kLn2Part1, low = twos * kLn2Part2, r = high - low;
  double series = 0;
  for (int power = 14; power >= 2; --power) series = (1 + series) * r / power;
  // Now exp(r) = 1 + r + r * series, of which r was rounded.
  return std::ldexp(1 + (high + (r * series - low)), static_cast<int>(twos));
}

// Angle of the point (x, y), as std::atan2: from the first octant by symmetry.
double arc_tangent(double y, double x) {
  if (std::isnan(x) || std::isnan(y)) return x + y;
  const double across = std::abs(y), along = std::abs(x);
  double angle_rad = 0;
  if (std::isinf(across) && std::isinf(along)) {
    angle_rad = 0.5 * kHalfPi;
  } else if (across > along) {
    angle_rad = kHalfPi - (first_octant(along / across) - kHalfPiRest);
  } else if (along > 0) {
    angle_rad = first_octant(across / along);
  }
  if (std::signbit(x)) angle_rad = 2 * kHalfPi - (angle_rad - 2 * kHalfPiRest);
  return std::copysign(angle_rad, y);
}

double arc_sine(double x) { return arc_tangent(x, std::sqrt((1 - x) * (1 + x))); }

double arc_cosine(double x) { return arc_tangent(std::sqrt((1 - x) * (1 + x)), x); }

// √(x² + y²); scaled only where the squares would overflow or vanish.
double hypotenuse(double x, double y) {
  if (std::isinf(x) || std::isinf(y)) return std::numeric_limits<double>::infinity();
  const double square = x * x + y * y;
  if (square > 1e-280 && square < 1e300) return std::sqrt(square);
  const double larger = std::fmax(std::abs(x), std::abs(y));
  if (!(larger > 0)) return x * x + y * y;  // 0 or not a number
  const double a = x / larger, b = y / larger;
  return larger * std::sqrt(a * a + b * b);
}

}  // namespace foldcar
