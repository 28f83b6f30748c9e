// Cars on hills, hollows and patches: where they stand, energy, friction against closed forms, symmetry, determinism.
#include "../../suite.h"

#include <algorithm>
#include <cmath>

#include "../../closed_forms.h"
#include "../../full_speed.h"
#include "../../multibody_trial.h"
#include "multibody_car.h"
#include "trial.h"

using namespace foldcar;

namespace {

constexpr double kRadius_m = 0.06;

using Drive = DriveOf<MultibodyCar, StepOptions>;

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

TEST(test_on_a_hillside_it_rolls_as_far_as_its_tracks_differ) {
  const double sd_m = 0.25, hill_m = 0.06;
  const TerrainSpec terrain = one_hill({0, 0.25, 0, 10, sd_m, hill_m});
  Drive drive(kCar, scene_of(terrain, 0.8), 0);
  const double roll_rad = drive.run(0.5).roll_rad, half_m = 0.5 * drive.body.track_m * std::cos(roll_rad);
  // The highest under a tyre is where it is nearest to the crest.
  auto height_m = [&](double y_m) { return hill_m * std::exp(-(y_m - 0.25) * (y_m - 0.25) / (2 * sd_m * sd_m)); };
  const double expected = (height_m(half_m + 0.006) - height_m(-half_m + 0.006)) / drive.body.track_m;
  TEST_ASSERT_TRUE(expected > 0.1);
  TEST_ASSERT_DOUBLE_WITHIN(0.03 * expected, expected, std::sin(roll_rad));
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

TEST(test_locked_wheels_brake_with_the_friction_of_the_patch) {
  brakes_with_the_friction_of_the_patch<Drive>(kCar, 0.3);
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

// One axle ahead of the centre of mass, and the belly's rear corner dragging on a rail beside the middle. In a steady
// turn the drag's couple balances what the two torque lines and the tail's own slip across the way hold against it. The
// simulated belly resists a slip across its way more than Coulomb's friction would: it turns less, to the same side.
TEST(test_a_belly_that_drags_beside_the_middle_turns_the_car_to_that_side) {
  constexpr double kAxle_m = 0.01, kTail_m = -0.03, kRail_m = 0.07, kFriction = 0.6, kTime_s = 2, kFraction = 0.1;
  BodySpec body = study_car(0.17);
  body.segments[0].length_m = -2 * kTail_m;
  body.track_m = 0.2;
  body.wheels.resize(2);
  for (WheelSpec& wheel : body.wheels) wheel.x_m = kAxle_m;
  const CarConstants car(body);
  const ServoSpec& servo = body.wheels[0].servo;
  const double tail_m = kAxle_m - kTail_m, speed_m_s = kFraction * servo.no_load_speed_rad_s * kRadius_m;
  const double line_n_s_m = servo.stall_torque_n_m / (servo.no_load_speed_rad_s * kRadius_m * kRadius_m);
  for (const double grip : {0.3, 0.0}) {
    body.segments[0].grip = grip;
    const double drag_n = kFriction * grip * car.mass_kg * kGravity * (kAxle_m - car.com_x_m) / tail_m;
    const double held_n_m_s = 0.5 * line_n_s_m * body.track_m * body.track_m + drag_n * tail_m * tail_m / speed_m_s;
    const double coulomb_rad = drag_n * kRail_m / held_n_m_s * kTime_s;
    for (const double side : {1.0, -1.0}) {
      const TerrainSpec rail = blocks({{0, side * kRail_m, 4, 0.026, 0.034, 0}});
      Drive drive(body, scene_of(rail, kFriction), 0);
      const double start_rad = drive.run(0.5).heading_rad;
      drive.pulses_us = pulses_for(body, kFraction);
      const double turn_rad = side * (drive.run(kTime_s).heading_rad - start_rad);
      TEST_ASSERT_TRUE(turn_rad > 0.15 * coulomb_rad - 0.001 && turn_rad < coulomb_rad + 0.001);
    }
  }
}

// Drive, scrub and belly all take the patch's friction: it makes no difference what lies under it. The car is told to
// turn at a bump and drags its belly, for it has one axle; nothing in that hangs on the last digit of a number.
TEST(test_a_patch_over_everything_is_the_ground) {
  BodySpec body = kCar;
  body.wheels.resize(2);
  SceneSpec slippery;
  slippery.terrain = blocks({{0.5, 0, 0.06, 2, 0.01, 0}});
  slippery.course = {-0.5, 2, -1, 1};
  SceneSpec bare = slippery, patched = slippery;
  slippery.friction = 0.35;
  bare.friction = patched.friction = 0.6;
  patched.terrain.patches = {{0, 0, 0, 20, 20, 0.35}};
  TrialSpec trial = full_speed(body, 20);
  trial.speed_m_s = 0.4;
  trial.yaw_rate_rad_s = 3;
  trial.time_limit_s = 3;
  const TrialResult a = run_trial(body, slippery, trial), b = run_trial(body, patched, trial);
  const TrialResult other = run_trial(body, bare, trial);
  TEST_ASSERT_EQUAL_STRING(text(a.outcome), text(b.outcome));
  TEST_ASSERT_EQUAL_UINT(a.path.size(), b.path.size());
  double apart = 0;
  for (std::size_t i = 0; i < a.path.size(); ++i) {
    for (std::size_t j = 0; j < 7; ++j) TEST_ASSERT_DOUBLE_WITHIN(1e-4, a.path[i][j], b.path[i][j]);
    if (i < other.path.size()) apart = std::max(apart, std::abs(a.path[i][1] - other.path[i][1]));
  }
  TEST_ASSERT_TRUE(apart > 0.05);
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

// The highest roll of one run hangs on which wheel lands first; the mean over hills half a centimetre apart does not.
TEST(test_a_mirrored_hill_is_driven_as_a_mirror_image) {
  constexpr int kHills = 5;
  double left_rad = 0, right_rad = 0, left_m = 0, right_m = 0, left_turn = 0, right_turn = 0;
  for (int i = 0; i < kHills; ++i) {
    const double y_m = 0.08 + 0.005 * i;
    const TrialResult left = run_trial(kCar, field(one_hill({0.5, y_m, 0.4, 0.1, 0.07, 0.06})), kTrial);
    const TrialResult right = run_trial(kCar, field(one_hill({0.5, -y_m, -0.4, 0.1, 0.07, 0.06})), kTrial);
    TEST_ASSERT_EQUAL_STRING("passed", text(left.outcome));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, left.elapsed_time_s, right.elapsed_time_s);
    const PathRow &a = left.path.back(), &b = right.path.back();
    TEST_ASSERT_TRUE(left.max_roll_rad > 0.1 && std::abs(a[2]) > 0.02);
    left_m += a[2] / kHills;
    right_m += b[2] / kHills;
    left_turn += a[4] / kHills;
    right_turn += b[4] / kHills;
    left_rad += left.max_roll_rad / kHills;
    right_rad += right.max_roll_rad / kHills;
  }
  TEST_ASSERT_DOUBLE_WITHIN(0.005, left_rad, right_rad);
  TEST_ASSERT_DOUBLE_WITHIN(0.005, left_m, -right_m);
  TEST_ASSERT_DOUBLE_WITHIN(0.01, left_turn, -right_turn);
}

TEST(test_a_turned_hill_changes_nothing_but_the_direction) {
  const double turn_rad = 1.1, c = std::cos(turn_rad), s = std::sin(turn_rad);
  const SceneSpec plain = field(one_hill({0.5, 0.1, 0.4, 0.1, 0.07, 0.06}));
  SceneSpec turned = field(one_hill({0.5 * c - 0.1 * s, 0.5 * s + 0.1 * c, 0.4 + turn_rad, 0.1, 0.07, 0.06}));
  turned.start = {0, 0, turn_rad};
  turned.goal = GoalSpec{GoalSpec::Kind::kLine, 1.2 * c, 1.2 * s, turn_rad, 0};
  const TrialResult a = run_trial(kCar, plain, kTrial), b = run_trial(kCar, turned, kTrial);
  const PathRow &p = a.path.back(), &r = b.path.back();
  TEST_ASSERT_DOUBLE_WITHIN(0.02, a.elapsed_time_s, b.elapsed_time_s);
  TEST_ASSERT_DOUBLE_WITHIN(0.005, p[1], c * r[1] + s * r[2]);
  TEST_ASSERT_DOUBLE_WITHIN(0.005, p[2], c * r[2] - s * r[1]);
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
