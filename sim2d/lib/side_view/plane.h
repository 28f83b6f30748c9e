// Conversion between SI and Box2D's units. Box2D's contact slop is 5 mm of its length unit, too coarse for a car of 0.2
// m; the plane is therefore simulated at 20 units a metre. Masses and times keep their values.
#pragma once

#include <box2d/box2d.h>

namespace foldcar {

// Box2D's length units a metre, and its torque units a newton metre (mass and time unchanged).
constexpr double kUnitsPerMetre = 20.0;
constexpr double kTorqueScale = kUnitsPerMetre * kUnitsPerMetre;

// Box2D keeps polygons and chains apart by a skin. Wheels and bellies are made smaller by it, so that they touch at
// their real outline.
constexpr double kPolygonSkin_m = b2_polygonRadius / kUnitsPerMetre;
constexpr double kWheelSkin_m = (b2_polygonRadius - 0.7 * b2_linearSlop) / kUnitsPerMetre;
// Profile details shorter than this are merged: Box2D aborts on chain vertices closer than its slop.
constexpr double kProfileResolution_m = 3 * b2_linearSlop / kUnitsPerMetre;

// Lengths, velocities and forces: SI to Box2D's units, and back.
inline float to_units(double metres) { return static_cast<float>(metres * kUnitsPerMetre); }
inline double to_metres(double units) { return units / kUnitsPerMetre; }
inline float to_torque_units(double newton_metres) { return static_cast<float>(newton_metres * kTorqueScale); }
inline b2Vec2 to_units(double x_m, double z_m) { return {to_units(x_m), to_units(z_m)}; }

// The friction of a fixture whose contact with the terrain shall have that coefficient: Box2D takes the geometric mean
// of both fixtures, and the terrain's is 1.
inline float fixture_friction(double coefficient) { return static_cast<float>(coefficient * coefficient); }

// Mass and moment of inertia about the body's origin, where its centre of mass is.
inline void set_mass(b2Body& body, double mass_kg, double inertia_kg_m2) {
  b2MassData data;
  data.mass = static_cast<float>(mass_kg);
  data.I = static_cast<float>(inertia_kg_m2 * kTorqueScale);
  data.center.SetZero();
  body.SetMassData(&data);
}

}  // namespace foldcar
