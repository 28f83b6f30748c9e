// What the side view is built from, on its own: standing heights and the car's constants.
#include <unity.h>

#include <cmath>
#include <limits>

#include "../study_car.h"
#include "car_constants.h"
#include "standing_height.h"

using namespace foldcar;

void setUp() {}
void tearDown() {}

namespace {

constexpr double kPi = 3.14159265358979323846;

WheelSpec wheel(double radius_m, double eccentricity_m = 0, double phase_rad = 0) {
  WheelSpec spec;
  spec.radius_m = radius_m;
  spec.eccentricity_m = eccentricity_m;
  spec.eccentricity_phase_rad = phase_rad;
  return spec;
}

Profile segment(double s0_m, double s1_m, double z0_m, double z1_m) { return {{s0_m, s1_m, z0_m, z1_m, 0, 0}}; }

}  // namespace

void test_an_axle_stands_a_radius_over_level_ground_and_a_radius_along_the_normal_over_a_slope() {
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.07, axle_height_m(segment(-1, 1, 0.01, 0.01), 0.3, wheel(0.06)));
  // The centre of a circle on the line z = s·tan(a) is r/cos(a) over it. The line's own points are sampled at the ends
  // of the wheel's reach and below its centre: a slope's touching point is between them, so a little height is missed.
  const double slope_rad = 0.1, rise = std::tan(slope_rad);
  const double height_m = axle_height_m(segment(-1, 1, -rise, rise), 0.2, wheel(0.06));
  TEST_ASSERT_DOUBLE_WITHIN(0.06 * (1 / std::cos(slope_rad) - 1) + 1e-12, 0.2 * rise + 0.06 / std::cos(slope_rad), height_m);
  TEST_ASSERT_TRUE(height_m >= 0.2 * rise + 0.06 - 1e-12);
}

void test_an_axle_beside_an_edge_stands_on_it_by_pythagoras_and_beyond_it_not_at_all() {
  const double radius_m = 0.06, edge_m = 0.02;
  for (const double side : {1.0, -1.0}) {
    const Profile block = side > 0 ? segment(0, 1, edge_m, edge_m) : segment(-1, 0, edge_m, edge_m);
    for (const double before_m : {0.01, 0.03, 0.059}) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-12, edge_m + std::sqrt(radius_m * radius_m - before_m * before_m),
                                axle_height_m(block, -side * before_m, wheel(radius_m)));
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, edge_m + radius_m, axle_height_m(block, side * 0.01, wheel(radius_m)));
    TEST_ASSERT_TRUE(axle_height_m(block, -side * 0.061, wheel(radius_m)) == std::numeric_limits<double>::lowest());
  }
}

void test_an_eccentric_wheel_stands_on_its_tyres_middle() {
  const double radius_m = 0.06, off_m = 0.004;
  const Profile level = segment(-1, 1, 0, 0), edge = segment(0, 1, 0, 0);
  for (const double phase_rad : {0.0, 0.7, 0.5 * kPi, 3.0}) {
    const WheelSpec spec = wheel(radius_m, off_m, phase_rad);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, radius_m - off_m * std::sin(phase_rad), axle_height_m(level, 0.1, spec));
    const double before_m = 0.03 - off_m * std::cos(phase_rad);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12,
                              std::sqrt(radius_m * radius_m - before_m * before_m) - off_m * std::sin(phase_rad),
                              axle_height_m(edge, -0.03, spec));
  }
}

void test_a_belly_rests_on_the_highest_ground_below_it() {
  SegmentSpec spec;
  spec.x_m = 0.05;
  spec.length_m = 0.1;
  spec.height_m = 0.04;
  spec.center_z_m = 0.005;
  const double bottom_m = -0.015, reference_m = 0.02;  // the belly lies over s = -0.02 to 0.08
  Profile ground{{-1, -0.021, 0.09, 0.09, 0, 0}, {-0.021, 0.03, 0.01, 0.02, 0, 0}, {0.03, 0.081, 0.02, 0.005, 0, 0},
                 {0.081, 1, 0.08, 0.08, 0, 0}};
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02 - bottom_m, resting_axle_height_m(ground, spec, reference_m));
  ground[1].z1_m = 0.01;
  ground[2].z1_m = 0.03;
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.03 - bottom_m, resting_axle_height_m(ground, spec, reference_m));
  ground[0].s1_m = -0.019;
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.09 - bottom_m, resting_axle_height_m(ground, spec, reference_m));
  ground[0].s1_m = -0.021;
  ground[3].s0_m = 0.079;
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.08 - bottom_m, resting_axle_height_m(ground, spec, reference_m));
}

void test_the_constants_hold_the_largest_the_lowest_and_the_farthest() {
  BodySpec body = hinged_study_car(0.115, 1);
  body.wheels[2].width_m = 0.02;
  body.wheels[3].radius_m = 0.05;
  body.wheels[3].eccentricity_m = 0.002;
  body.segments[1].width_m = 0.13;
  body.segments[1].center_z_m = -0.01;
  CarConstants car(body);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02, car.tyre_width_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0575, car.wheel_radius_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.13, car.belly_width_m);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.0575 - 0.01 - 0.025, car.belly_clearance_m);
  // The main segment is the front one, its centre of mass at 0.05 m; the rear wheel's rim is the farthest.
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.05 + 0.07 + 0.06, car.reach_m);
  body.wheels[3].radius_m = 0.061;
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.05 + 0.07 + 0.063, CarConstants(body).reach_m);
  body.segments[1].x_m = -0.15;
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.05 + 0.15 + 0.05, CarConstants(body).reach_m);
}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_an_axle_stands_a_radius_over_level_ground_and_a_radius_along_the_normal_over_a_slope);
  RUN_TEST(test_an_axle_beside_an_edge_stands_on_it_by_pythagoras_and_beyond_it_not_at_all);
  RUN_TEST(test_an_eccentric_wheel_stands_on_its_tyres_middle);
  RUN_TEST(test_a_belly_rests_on_the_highest_ground_below_it);
  RUN_TEST(test_the_constants_hold_the_largest_the_lowest_and_the_farthest);
  return UNITY_END();
}
