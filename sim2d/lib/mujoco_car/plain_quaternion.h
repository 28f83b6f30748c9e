// Writes quaternions (w, x, y, z) into MuJoCo's arrays.
#pragma once

#include <cmath>

namespace foldcar {

inline void set_quaternion(double* to, double w, double x, double y, double z) {
  to[0] = w;
  to[1] = x;
  to[2] = y;
  to[3] = z;
}

// A turn about the vertical.
inline void set_heading(double* to, double heading_rad) {
  set_quaternion(to, std::cos(0.5 * heading_rad), 0, 0, std::sin(0.5 * heading_rad));
}

}  // namespace foldcar
