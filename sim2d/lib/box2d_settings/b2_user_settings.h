// Box2D's settings, which its b2_settings.h includes where B2_USER_SETTINGS is defined (platformio.ini): its own sources and
// all that include its headers call our elementary functions in place of the C library's, and read no clock.
#pragma once

#include <box2d/b2_types.h>

#include <cmath>
#include <cstdarg>
#if defined(__linux__) || defined(__APPLE__)
#include <sys/time.h>
#endif

#include "elementary_functions.h"

namespace foldcar {

// Box2D takes sine and cosine of every body's angle many times a step: in double precision and with short series, whose
// error of 1e-11 leaves nearly every result the nearest float. Inline, so that both of one angle share their terms.
inline SineCosine short_sine_and_cosine(float angle_rad) {
  if (std::abs(angle_rad) < kSmallAngle_rad) return {angle_rad, 1};  // the ground's
  if (!(std::abs(angle_rad) <= kExactReduction_rad)) return sine_and_cosine(angle_rad);
  const double quarters = (angle_rad * kQuartersPerRad + kRounder) - kRounder;
  const double r = (angle_rad - quarters * kQuarterPart1_rad) - quarters * kQuarterPart2_rad, z = r * r;
  const double s =
      r + r * z * (-1 / 6.0 + z * (1 / 120.0 + z * (-1 / 5040.0 + z * (1 / 362880.0 - z * (1 / 39916800.0)))));
  const double series =
      1 / 24.0 + z * (-1 / 720.0 + z * (1 / 40320.0 + z * (-1 / 3628800.0 + z * (1 / 479001600.0))));
  return turned_by(static_cast<int>(quarters), s, 1 - 0.5 * z + z * z * series);
}

inline float box2d_sine(float angle_rad) { return static_cast<float>(short_sine_and_cosine(angle_rad).sine); }
inline float box2d_cosine(float angle_rad) { return static_cast<float>(short_sine_and_cosine(angle_rad).cosine); }
inline float box2d_exponential(float x) { return static_cast<float>(exponential(x)); }
inline float box2d_arc_tangent(float y, float x) { return static_cast<float>(arc_tangent(y, x)); }

// Box2D times itself, nine readings a step, an eighth of a run.
template <typename Time>
int box2d_time(Time* now) {
  *now = {};
  return 0;
}

}  // namespace foldcar

#define sinf(x) foldcar::box2d_sine(x)
#define cosf(x) foldcar::box2d_cosine(x)
#define expf(x) foldcar::box2d_exponential(x)
#define atan2f(y, x) foldcar::box2d_arc_tangent(y, x)
#define gettimeofday(now, zone) foldcar::box2d_time(now)

// What b2_settings.h defines without B2_USER_SETTINGS.
#define b2_lengthUnitsPerMeter 1.0f
#define b2_maxPolygonVertices 8

struct b2BodyUserData {};
struct b2JointUserData {};
struct b2FixtureUserData {
  const double* grip = nullptr;
};

void* b2Alloc_Default(int32 size);
void b2Free_Default(void* memory);
void b2Log_Default(const char* format, va_list values);

inline void* b2Alloc(int32 size) { return b2Alloc_Default(size); }
inline void b2Free(void* memory) { b2Free_Default(memory); }
inline void b2Log(const char* format, ...) {
  va_list values;
  va_start(values, format);
  b2Log_Default(format, values);
  va_end(values);
}
