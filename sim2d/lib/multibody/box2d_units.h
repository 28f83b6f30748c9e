// Conversion between metres and Box2D's length unit. Its collision functions keep a tolerance of 0.005 units, too coarse
// for a car of 0.2 m: the plane has 20 units a metre.
#pragma once

#include <box2d/box2d.h>

namespace foldcar {

constexpr double kUnitsPerMetre = 20.0;

// Profile details shorter than this are merged.
constexpr double kProfileResolution_m = 3 * b2_linearSlop / kUnitsPerMetre;

inline float to_units(double metres) { return static_cast<float>(metres * kUnitsPerMetre); }
inline double to_metres(double units) { return units / kUnitsPerMetre; }
inline b2Vec2 to_units(double x_m, double z_m) { return {to_units(x_m), to_units(z_m)}; }

}  // namespace foldcar
