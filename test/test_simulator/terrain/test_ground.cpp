// Cars on hills, hollows and patches: where they stand, energy, friction against closed forms, symmetry, determinism.
#include "../../suite.h"

#include <algorithm>
#include <cmath>

#include "../multibody_bench.h"

using namespace foldcar;

namespace {

constexpr double kRadius_m = 0.06;

TerrainSpec one_hill(const HillSpec& hill) {
  TerrainSpec terrain;
  terrain.hills = {hill};
  return terrain;
}

// Servos so strong that neutral pulses lock the wheels.
BodySpec locking_car() {
  BodySpec body = study_car(0.115);
  for (WheelSpec& wheel : body.wheels) wheel.servo.stall_torque_n_m = 0.5;
  return body;
}

const BodySpec kCar = study_car(0.115);
const TrialSpec kTrial = full_speed(kCar, 20);

SceneSpec field(const TerrainSpec& terrain) {
  SceneSpec scene;
  scene.friction = 0.6;
  scene.terrain = terrain;
  scene.goal = GoalSpec{GoalSpec::Kind::kLine, 1.2, 0, 0, 0};
  scene.course = {-2, 2, -2, 2};
  return scene;
}

// What a wheel of the car touches at its lowest: the axle's height over a function of x, by sampling.
template <typename Height>
double axle_height_m(double x_m, const Height& height_m) {
  double axle_m = -1;
  for (double dx = -kRadius_m; dx <= kRadius_m; dx += 1e-5) {
    axle_m = std::max(axle_m, height_m(x_m + dx) + std::sqrt(std::max(0.0, kRadius_m * kRadius_m - dx * dx)));
  }
  return axle_m;
}

}  // namespace

TEST(test_it_stands_on_a_hill_and_in_a_hollow_as_high_as_its_wheels_touch) {
  for (const double hill_m : {0.05, -0.05}) {
    const double sd_m = 0.25;
    const TerrainSpec terrain = one_hill({0, 0, 0, sd_m, 10, hill_m});
    Drive drive(kCar, scene_of(terrain, 0.8), 0);
    const double expected_m =
        axle_height_m(0.07, [&](double x_m) { return hill_m * std::exp(-x_m * x_m / (2 * sd_m * sd_m)); });
    TEST_ASSERT_DOUBLE_WITHIN(0.0006, expected_m, drive.run(0.5).z_m);
    TEST_ASSERT_DOUBLE_WITHIN(0.003, 0, drive.car.state().pitch_rad);
  }
}

TEST(test_over_a_smooth_hill_motor_work_becomes_mechanical_energy) {
  const BodySpec body = without_rotors(kCar);
  const TerrainSpec terrain = one_hill({0.6, 0, 0, 0.15, 5, 0.05});
  Drive drive(body, scene_of(terrain, 2.0), 0);
  drive.run(0.5);
  const double climb_j = CarConstants(body).mass_kg * kGravity * 0.05;
  const double energy_j = drive.car.mechanical_energy_j(), work_j = drive.car.state().motor_work_j;
  drive.pulses_us = pulses_for(body, 0.4);
  double highest_m = 0;
  while (drive.car.state().x_m < 0.9) {
    drive.run(drive.step_s);
    highest_m = std::max(highest_m, drive.car.state().z_m);
    const double gained_j = drive.car.mechanical_energy_j() - energy_j;
    TEST_ASSERT_DOUBLE_WITHIN(0.04 * climb_j, drive.car.state().motor_work_j - work_j, gained_j);
  }
  TEST_ASSERT_TRUE(highest_m > kRadius_m + 0.04);
  TEST_ASSERT_TRUE(drive.car.state().z_m < kRadius_m + 0.012);
}

TEST(test_ice_under_one_side_brakes_half_and_turns_to_the_other) {
  TerrainSpec spec;
  spec.patches = {{2, 0.5, 0, 3, 1, 0.05}};  // the left wheels only
  Drive drive(locking_car(), scene_of(spec, 0.3), 1);
  while (drive.car.state().x_m < 0.75) drive.run(drive.step_s);
  const double heading_rad = drive.car.state().heading_rad;
  drive.pulses_us = pulses_for(drive.body, 0);
  // When its nose has come down, and before it has turned much: locked wheels do not hold a car straight.
  const double early_m_s = drive.run(0.06).speed_m_s, late_m_s = drive.run(0.08).speed_m_s;
  const double expected = 0.5 * (0.05 + 0.3) * kGravity;
  TEST_ASSERT_DOUBLE_WITHIN(0.05 * expected, expected, (early_m_s - late_m_s) / 0.08);
  TEST_ASSERT_TRUE(drive.car.state().heading_rad < heading_rad - 0.01);
}

// The belly on a ramp between the wheels, which hang free: it holds or slides by the friction under it.
TEST(test_a_belly_slides_on_a_slippery_ramp) {
  const double length_m = 0.8, height_m = 0.22, slope_rad = std::atan(height_m / length_m);
  BodySpec body = kCar;
  body.segments[0].grip = 0.5;
  TerrainSpec spec = blocks({{0, 0, length_m, 0.09, height_m, 0, BlockSpec::Kind::kRamp}});
  Drive held(body, scene_of(spec, 0.7, {0.15, 0, 0}), 0);
  const double before_m = held.run(0.5).x_m;
  TEST_ASSERT_DOUBLE_WITHIN(0.01, slope_rad, held.car.state().pitch_rad);
  TEST_ASSERT_DOUBLE_WITHIN(0.002, before_m, held.run(0.5).x_m);
  spec.patches = {{0, 0, 0, 2, 2, 0.2}};
  Drive sliding(body, scene_of(spec, 0.7, {0.15, 0, 0}), 0);
  const double early_m_s = sliding.run(0.25).speed_m_s, late_m_s = sliding.run(0.2).speed_m_s;
  const double along = std::sin(slope_rad) - 0.5 * 0.2 * std::cos(slope_rad);
  const double expected = kGravity * along * std::cos(slope_rad);
  TEST_ASSERT_DOUBLE_WITHIN(0.05 * expected, expected, (early_m_s - late_m_s) / 0.2);
}

// A hill askew under one front wheel pushes it aside, which turns the car down the flank where friction is low. Over
// ten such hills MuJoCo turns the same car by 0.2 to 1 rad on ice, 0.59 in the mean, and by 0.06 on dry ground.
TEST(test_a_flank_turns_the_car_where_friction_is_low) {
  const BodySpec body = study_car(0.245);
  constexpr int kHills = 5;
  double icy_mean_rad = 0;
  for (int i = 0; i < 2 * kHills; ++i) {
    const double side = i % 2 == 0 ? 1 : -1, y_m = 0.09 + 0.015 * (i / 2);
    SceneSpec scene = field(one_hill({0.5, side * y_m, side * -0.5, 0.06, 0.1, 0.05}));
    scene.friction = 0.6;
    const double dry_rad = side * run_trial(body, scene, full_speed(body, 20)).path.back()[4];
    scene.friction = 0.25;
    const double icy_rad = side * run_trial(body, scene, full_speed(body, 20)).path.back()[4];
    TEST_ASSERT_TRUE(dry_rad > 0 && dry_rad < 0.12 && icy_rad > 0.15);
    icy_mean_rad += icy_rad / (2 * kHills);
  }
  TEST_ASSERT_TRUE(icy_mean_rad > 0.3 && icy_mean_rad < 1.2);
}

TEST(test_the_same_ground_gives_the_same_numbers_whoever_made_it) {
  SceneSpec scene = field(one_hill({0.5, 0.1, 0.4, 0.1, 0.07, 0.06}));
  scene.terrain.roughs = {{0.6, 0, 0, 1, 1, 0.003, 0.03, 9}};
  scene.terrain.potholes = {{0.8, -0.06, 0.05, 0.02, 0.02}};
  scene.terrain.patches = {{0.9, 0, 0, 0.2, 1, 0.3}};
  const SceneTerrain terrain(scene.terrain);
  const TrialResult own = run_trial(kCar, scene, kTrial);
  for (int i = 0; i < 2; ++i) {
    const TrialResult shared = run_trial(kCar, scene, kTrial, {}, nullptr, &terrain);
    TEST_ASSERT_TRUE(own.path == shared.path && own.consumed_energy_j == shared.consumed_energy_j);
  }
}
