// Vectors and rotations in three dimensions, as little as the dynamics need.
#pragma once

#include <cmath>

#include "elementary_functions.h"

namespace foldcar {

struct Vec3 {
  double x = 0, y = 0, z = 0;
};

inline Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator*(double k, const Vec3& a) { return {k * a.x, k * a.y, k * a.z}; }
inline double dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vec3 unit(const Vec3& a) { return (1 / std::sqrt(dot(a, a))) * a; }

// A rotation by its columns: the forward, left and up axes of a body in the world.
struct Rotation {
  Vec3 forward{1, 0, 0}, left{0, 1, 0}, up{0, 0, 1};
  Vec3 to_world(const Vec3& a) const { return a.x * forward + a.y * left + a.z * up; }
  Vec3 to_body(const Vec3& a) const { return {dot(a, forward), dot(a, left), dot(a, up)}; }
};

// Rotation by the vector's length (rad) about its direction.
inline Rotation rotation_by(const Vec3& turn) {
  const double angle = std::sqrt(dot(turn, turn));
  // Series where the angle is too small to divide by.
  double a = 1 - angle * angle / 6, b = 0.5 - angle * angle / 24;
  if (!(angle < 1e-4)) {
    const auto [s, c] = sine_and_cosine(angle);
    a = s / angle;
    b = (1 - c) / (angle * angle);
  }
  const auto column = [&](const Vec3& axis) {
    const Vec3 once = cross(turn, axis);
    return axis + a * once + b * cross(turn, once);
  };
  return {column({1, 0, 0}), column({0, 1, 0}), column({0, 0, 1})};
}

// first, then second in the frame that first leads to.
inline Rotation operator*(const Rotation& first, const Rotation& second) {
  Rotation both{first.to_world(second.forward), first.to_world(second.left), {}};
  // Rounding errors are removed, lest they add up.
  both.forward = unit(both.forward);
  both.left = unit(both.left - dot(both.left, both.forward) * both.forward);
  both.up = cross(both.forward, both.left);
  return both;
}

}  // namespace foldcar
