// Whole trials, firmware in the loop: determinism, mirror symmetry, time step, endings, the HAL's contract.
#include "../../suite.h"

#include <cmath>
#include <cstring>

#include "../../hal_contract.h"
#include "../multibody_bench.h"
#include "ending.h"
#include "sim_hal.h"
#include "supervisor.h"

using namespace foldcar;

namespace {

SceneSpec flat() {
  SceneSpec scene;
  scene.friction = 0.6;
  scene.goal = GoalSpec{GoalSpec::Kind::kLine, 1.0, 0, 0, 0};
  scene.course = {-0.5, 2, -1, 1};
  return scene;
}

SceneSpec one_obstacle(double y_m, double heading_rad, bool hill) {
  SceneSpec scene = flat();
  if (hill) {
    scene.terrain.hills = {{0.4, y_m, heading_rad, 0.1, 0.07, 0.05}};
  } else {
    scene.terrain.blocks = {{0.4, y_m, 0.15, 0.2, 0.02, heading_rad}};
  }
  return scene;
}

// The car of most trials, at full speed.
const BodySpec kBody = study_car(0.115);
const TrialSpec kTrial = full_speed(kBody);

}  // namespace

TEST(test_the_simulated_hal_keeps_the_contract) {
  SimHal board(4.0);
  std::uint64_t now_us = 0;
  check_hal_contract(board.hal(), [&] { board.clock.advance_to_us(now_us += 4167); });
}

TEST(test_the_same_trial_gives_the_same_numbers_with_a_stopwatch_too) {
  Stopwatch stopwatch;
  const BodySpec body = study_car(0.18);
  const TrialResult first = run_trial(body, pyramids(), full_speed(body));
  run_trial(study_car(0.065), pyramids(), full_speed(body));  // another car in between leaves nothing behind
  const TrialResult again = run_trial(body, pyramids(), full_speed(body), {}, &stopwatch);
  TEST_ASSERT_EQUAL_INT(static_cast<int>(first.outcome), static_cast<int>(again.outcome));
  TEST_ASSERT_TRUE(first.elapsed_time_s == again.elapsed_time_s && first.path == again.path);
  TEST_ASSERT_TRUE(first.consumed_energy_j == again.consumed_energy_j);
  TEST_ASSERT_TRUE(stopwatch.physics_s > 0 && stopwatch.terrain_s > 0 && stopwatch.firmware_s > 0);
}

// Where one run ends hangs on which wheel lands first; the mean over obstacles half a centimetre apart does so less.
TEST(test_a_mirrored_scene_is_driven_as_a_mirror_image) {
  constexpr int kPlaces = 5;
  for (const bool hill : {false, true}) {
    double left_m = 0, right_m = 0, left_rad = 0, right_rad = 0;
    for (int i = 0; i < kPlaces; ++i) {
      const double y_m = 0.08 + 0.005 * i;
      const TrialResult left = run_trial(kBody, one_obstacle(y_m, 0.1, hill), kTrial);
      const TrialResult right = run_trial(kBody, one_obstacle(-y_m, -0.1, hill), kTrial);
      TEST_ASSERT_EQUAL_STRING("passed", text(left.outcome));
      TEST_ASSERT_EQUAL_STRING("passed", text(right.outcome));
      TEST_ASSERT_DOUBLE_WITHIN(0.05, left.elapsed_time_s, right.elapsed_time_s);
      TEST_ASSERT_DOUBLE_WITHIN(0.03, left.max_roll_rad, right.max_roll_rad);
      left_m += left.path.back()[2] / kPlaces;
      right_m += right.path.back()[2] / kPlaces;
      left_rad += left.path.back()[4] / kPlaces;
      right_rad += right.path.back()[4] / kPlaces;
    }
    TEST_ASSERT_TRUE(std::abs(left_m) > 0.005);  // it is turned away from the obstacle's side: something to mirror
    TEST_ASSERT_DOUBLE_WITHIN(0.01, left_m, -right_m);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, left_rad, -right_rad);
  }
}

TEST(test_a_turned_world_changes_nothing_but_the_direction) {
  const double turn_rad = 1.1, c = std::cos(turn_rad), s = std::sin(turn_rad);
  for (const bool hill : {false, true}) {
    const SceneSpec scene = one_obstacle(0.08, 0.1, hill);
    SceneSpec turned = scene;
    const auto turn = [&](auto& obstacle) {
      const double x_m = obstacle.x_m, y_m = obstacle.y_m;
      obstacle.x_m = c * x_m - s * y_m;
      obstacle.y_m = s * x_m + c * y_m;
      obstacle.heading_rad += turn_rad;
    };
    for (BlockSpec& block : turned.terrain.blocks) turn(block);
    for (HillSpec& one : turned.terrain.hills) turn(one);
    turned.start = {0, 0, turn_rad};
    turned.goal = GoalSpec{GoalSpec::Kind::kLine, c, s, turn_rad, 0};
    turned.course = {-2, 2, -2, 2};
    const TrialResult plain = run_trial(kBody, scene, kTrial);
    const TrialResult rotated = run_trial(kBody, turned, kTrial);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, plain.elapsed_time_s, rotated.elapsed_time_s);
    const PathRow &a = plain.path.back(), &b = rotated.path.back();
    TEST_ASSERT_DOUBLE_WITHIN(0.01, a[1], c * b[1] + s * b[2]);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, a[2], c * b[2] - s * b[1]);
  }
}

// One run over steps hangs on which edge is met first, and may even leave the course; the mean of those that pass with
// both steps, started a few millimetres apart, does not.
TEST(test_half_the_time_step_tells_the_same_story) {
  StepOptions fine;
  fine.rate_hz = 480;
  constexpr int kStarts = 9;
  for (const double width_m : {0.115, 0.145}) {
    const BodySpec body = study_car(width_m);
    double coarse_s = 0, fine_s = 0, coarse_j = 0, fine_j = 0;
    int passed = 0;
    for (int i = 0; i < kStarts; ++i) {
      SceneSpec scene = pyramids();
      scene.start.y_m = 0.003 * (i - kStarts / 2);
      const TrialResult coarse = run_trial(body, scene, full_speed(body));
      const TrialResult halved = run_trial(body, scene, full_speed(body), fine);
      if (coarse.outcome != Outcome::kPassed || halved.outcome != Outcome::kPassed) continue;
      ++passed;
      coarse_s += coarse.elapsed_time_s;
      fine_s += halved.elapsed_time_s;
      coarse_j += coarse.consumed_energy_j;
      fine_j += halved.consumed_energy_j;
    }
    TEST_ASSERT_TRUE(passed >= kStarts - 1);
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * fine_s, fine_s, coarse_s);
    TEST_ASSERT_DOUBLE_WITHIN(0.03 * fine_j, fine_j, coarse_j);
  }
}

TEST(test_too_narrow_a_car_tips_and_too_wide_a_one_sticks) {
  const BodySpec narrow = study_car(0.065), wide = study_car(0.245);
  TEST_ASSERT_EQUAL_STRING("tipped", text(run_trial(narrow, pyramids(), full_speed(narrow)).outcome));
  TEST_ASSERT_EQUAL_STRING("stuck", text(run_trial(wide, pyramids(), full_speed(wide)).outcome));
}

TEST(test_the_flat_is_crossed_in_the_time_the_speed_takes_to_a_disc_or_a_line) {
  for (const bool disc : {false, true}) {
    SceneSpec scene = flat();
    scene.course.x_max_m = 4;
    scene.goal->x_m = 3;
    if (disc) scene.goal = GoalSpec{GoalSpec::Kind::kDisc, 3, 0.03, 0, 0.05};
    TrialSpec trial = kTrial;
    trial.speed_m_s = 0.5;
    const TrialResult result = run_trial(kBody, scene, trial);
    TEST_ASSERT_EQUAL_STRING("passed", text(result.outcome));
    // Slew limit and staggered start cost a part of a second.
    TEST_ASSERT_DOUBLE_WITHIN(0.3, 6.2, result.elapsed_time_s);
    TEST_ASSERT_DOUBLE_WITHIN(disc ? 0.004 : 0.02, disc ? 0.05 : 0, result.distance_to_target_m.value());
  }
}

TEST(test_without_a_goal_it_leaves_the_course_at_its_edge) {
  SceneSpec scene = flat();
  scene.goal.reset();
  scene.start.heading_rad = 0.5;
  scene.course.y_max_m = 0.2;
  const TrialResult result = run_trial(kBody, scene, kTrial);
  TEST_ASSERT_EQUAL_STRING("off_course", text(result.outcome));
  TEST_ASSERT_DOUBLE_WITHIN(0.005, 0.2, result.path.back()[2]);
  TEST_ASSERT_FALSE(result.distance_to_target_m.has_value());
}

// Down a ramp the nose only points down, along a hillside one side only is up: both count by their size.
TEST(test_the_largest_tilt_counts_to_both_sides) {
  const double rise_m = 0.12, length_m = 0.8;
  SceneSpec down = flat();
  down.terrain.blocks = {{-0.3, 0, 1, 2, rise_m, 0},
                         {0.2 + 0.5 * length_m, 0, length_m, 2, rise_m, 3.14159265358979323846, BlockSpec::Kind::kRamp}};
  const TrialResult nose = run_trial(kBody, down, kTrial);
  TEST_ASSERT_EQUAL_STRING("passed", text(nose.outcome));
  TEST_ASSERT_DOUBLE_WITHIN(0.02, std::atan(rise_m / length_m), nose.max_pitch_rad);
  for (const double side : {1.0, -1.0}) {
    SceneSpec across = flat();
    across.friction = 1;
    const double sd_m = 0.25, hill_m = 0.06, half_m = 0.5 * kBody.track_m;
    across.terrain.hills = {{0, side * sd_m, 0, 10, sd_m, hill_m}};
    across.goal->x_m = 0.3;
    const TrialResult roll = run_trial(kBody, across, kTrial);
    auto height_m = [&](double y_m) { return hill_m * std::exp(-0.5 * std::pow((y_m - sd_m) / sd_m, 2)); };
    const double expected_rad = std::asin((height_m(half_m + 0.006) - height_m(0.006 - half_m)) / kBody.track_m);
    TEST_ASSERT_EQUAL_STRING("passed", text(roll.outcome));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, expected_rad, roll.max_roll_rad);
  }
}

TEST(test_a_refused_trial_says_why) {
  TrialSpec trial = full_speed(kBody, 3000);
  try {
    run_trial(kBody, pyramids(), trial);
    TEST_FAIL_MESSAGE("accepted");
  } catch (const TrialError& error) {
    TEST_ASSERT_NOT_NULL(std::strstr(error.what(), text(Refusal::kTimeLimit)));
  }
}

// A car that hangs on its belly turns and rocks, and gets nowhere.
TEST(test_a_car_that_turns_where_it_is_ends_stuck_unless_it_was_told_to) {
  const SceneSpec scene = flat();
  const auto ends_s = [&](float speed_m_s, float yaw_rate_rad_s, double drift_m_s) {
    TrialRequest trial;
    trial.speed_m_s = speed_m_s;
    trial.yaw_rate_rad_s = yaw_rate_rad_s;
    CarState state;
    Ending ending(scene, state, trial);
    for (double t_s = 0; t_s < 20; t_s += 0.01) {
      state.heading_rad = 0.5 * t_s;
      state.x_m = 0.02 * std::sin(3 * t_s) + drift_m_s * t_s;
      if (ending.check(state, t_s)) return t_s;
    }
    return 20.0;
  };
  TEST_ASSERT_DOUBLE_WITHIN(0.02, 8, ends_s(0.6f, 0, 0));
  TEST_ASSERT_EQUAL_DOUBLE(20, ends_s(0, 0.5f, 0));
  TEST_ASSERT_EQUAL_DOUBLE(20, ends_s(0.6f, 0, 0.01));
}
