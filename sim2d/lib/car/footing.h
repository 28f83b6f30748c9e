// Where across its width a tyre or a belly stands: what an outline, the highest line of a strip, leaves out.
//
// Inputs: the terrain, the car's frame, and a contact in the plane. Outputs lengths across the car.
#pragma once

#include <optional>

#include "terrain.h"

namespace foldcar {

// A contact of something that lies across the car: its place ahead of the frame's point, the surface's normal into the
// car, and the strip.
struct StripContact {
  double ahead_m = 0;
  double z_m = 0;
  double normal_x = 0;
  double normal_z = 1;
  double middle_y_m = 0;  // of the strip, left of the frame's point
  double width_m = 0;
};

struct Footing {
  double middle_m = 0;  // of what stands, left of the strip's middle
  double width_m = 0;   // of what stands
};

// A strip that no edge runs under stands on its whole width. None if nothing is found where the contact is said to be.
std::optional<Footing> footing(const Terrain& terrain, const SliceFrame& frame, const StripContact& contact);

}  // namespace foldcar
