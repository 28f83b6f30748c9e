// How high a car stands that is put down on an outline: heights of axles over the plane's zero, metres.
#pragma once

#include "body_spec.h"
#include "profile.h"

namespace foldcar {

// Height that a wheel's axle needs at axle_s_m of the outline for the tyre to stand on it.
double axle_height_m(const Profile& profile, double axle_s_m, const WheelSpec& wheel);

// Height of the axles at which a segment's belly, put down inside an obstacle, rests on it; reference_m is the place
// along the car that stands at the outline's zero.
double resting_axle_height_m(const Profile& ground, const SegmentSpec& segment, double reference_m);

}  // namespace foldcar
