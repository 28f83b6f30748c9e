// Height at which a car stands on an outline: heights of its axle line over z = 0, metres.
#pragma once

#include "body_spec.h"
#include "profile.h"

namespace foldcar {

// Height of the axle of a wheel that stands on the outline with its axle at axle_s_m.
double axle_height_m(const Profile& profile, double axle_s_m, const WheelSpec& wheel);

// Height of the axle line at which the belly of a level segment rests on the outline; reference_m is the x (m) of the
// point of the car that stands at s = 0 of the outline.
double resting_axle_height_m(const Profile& ground, const SegmentSpec& segment, double reference_m);

}  // namespace foldcar
