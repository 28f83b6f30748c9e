// What multibody is built from, on its own: the car's constants.
#include "../suite.h"

#include "../study_car.h"
#include "car_constants.h"

using namespace foldcar;

TEST(test_the_constants_hold_the_largest_the_lowest_and_the_farthest) {
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
