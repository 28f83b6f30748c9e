#include "car_constants.h"

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

// Combines all segments to one rigid body: mass, centre of mass, roll and yaw inertia by the parallel axis theorem.
// The other members are those of the first segment.
SegmentSpec combined(const std::vector<SegmentSpec>& segments) {
  const SegmentSpec& first = segments.front();
  SegmentSpec one = first;
  double moment_x = 0, moment_y = 0, moment_z = 0;
  for (std::size_t j = 1; j < segments.size(); ++j) {
    const SegmentSpec& segment = segments[j];
    one.mass_kg += segment.mass_kg;
    one.roll_inertia_kg_m2 += segment.roll_inertia_kg_m2;
    one.yaw_inertia_kg_m2 += segment.yaw_inertia_kg_m2;
    moment_x += segment.mass_kg * (segment.com_x_m - first.com_x_m);
    moment_y += segment.mass_kg * (segment.com_y_m - first.com_y_m);
    moment_z += segment.mass_kg * (segment.com_z_m - first.com_z_m);
  }
  one.com_x_m += moment_x / one.mass_kg;
  one.com_y_m += moment_y / one.mass_kg;
  one.com_z_m += moment_z / one.mass_kg;
  for (const SegmentSpec& segment : segments) {
    const double dx = segment.com_x_m - one.com_x_m, dy = segment.com_y_m - one.com_y_m,
                 dz = segment.com_z_m - one.com_z_m;
    one.roll_inertia_kg_m2 += segment.mass_kg * (dy * dy + dz * dz);
    one.yaw_inertia_kg_m2 += segment.mass_kg * (dx * dx + dy * dy);
  }
  return one;
}

}  // namespace

// Computes the constants of the whole unfolded car, segments and wheels: mass, centre of mass, inertias about it, and
// the extent of tyres, bellies and reach (from the main segment's centre of mass).
CarConstants::CarConstants(const BodySpec& body) {
  const SegmentSpec chassis = combined(body.segments);
  const double half_track_m = 0.5 * body.track_m;
  const double reference_x_m = body.segments[main_segment(body)].com_x_m;
  double wheels_mass_kg = 0, wheels_moment_kg_m = 0, wheels_own_kg_m2 = 0, radius_sum_m = 0;
  tyre_width_m = reach_m = 0;
  for (const WheelSpec& wheel : body.wheels) {
    wheels_mass_kg += wheel.mass_kg;
    wheels_moment_kg_m += wheel.mass_kg * wheel.x_m;
    wheels_own_kg_m2 += 0.25 * wheel.mass_kg * wheel.radius_m * wheel.radius_m;  // a disc about its diameter
    radius_sum_m += wheel.radius_m;
    tyre_width_m = std::max(tyre_width_m, wheel.width_m);
    reach_m = std::max(reach_m, std::abs(wheel.x_m - reference_x_m) + wheel.radius_m + wheel.eccentricity_m);
  }
  mass_kg = chassis.mass_kg + wheels_mass_kg;
  wheel_radius_m = radius_sum_m / static_cast<double>(body.wheels.size());
  com_x_m = (chassis.mass_kg * chassis.com_x_m + wheels_moment_kg_m) / mass_kg;
  com_height_m = wheel_radius_m + chassis.com_z_m * chassis.mass_kg / mass_kg;
  side_moment_kg_m = chassis.mass_kg * chassis.com_y_m;
  double wheels_yaw_kg_m2 = 0;
  for (const WheelSpec& wheel : body.wheels) {
    const double dx = wheel.x_m - com_x_m;
    wheels_yaw_kg_m2 += wheel.mass_kg * (dx * dx + half_track_m * half_track_m);
  }
  const double chassis_dx = chassis.com_x_m - com_x_m;
  yaw_inertia_kg_m2 = chassis.yaw_inertia_kg_m2 + chassis.mass_kg * chassis_dx * chassis_dx + wheels_yaw_kg_m2 +
                      wheels_own_kg_m2;
  const double wheels_roll_kg_m2 = wheels_mass_kg * half_track_m * half_track_m;
  roll_inertia_kg_m2 = chassis.roll_inertia_kg_m2 + wheels_own_kg_m2 + wheels_roll_kg_m2;
  belly_width_m = 0;
  belly_clearance_m = wheel_radius_m;
  for (const SegmentSpec& segment : body.segments) {
    belly_width_m = std::max(belly_width_m, segment.width_m);
    belly_clearance_m =
        std::min(belly_clearance_m, wheel_radius_m + segment.center_z_m - 0.5 * segment.height_m);
    reach_m = std::max(reach_m, std::abs(segment.x_m - reference_x_m) + 0.5 * segment.length_m);
  }
}

}  // namespace foldcar
