// Writes vectors and quaternions (w, x, y, z) into MuJoCo's arrays.
#pragma once

#include "elementary_functions.h"

namespace foldcar {

inline void set_vector(double* to, double x, double y, double z) {
  to[0] = x;
  to[1] = y;
  to[2] = z;
}

inline void set_quaternion(double* to, double w, double x, double y, double z) {
  to[0] = w;
  to[1] = x;
  to[2] = y;
  to[3] = z;
}

// A turn about the vertical.
inline void set_heading(double* to, double heading_rad) {
  set_quaternion(to, cosine(0.5 * heading_rad), 0, 0, sine(0.5 * heading_rad));
}

}  // namespace foldcar
