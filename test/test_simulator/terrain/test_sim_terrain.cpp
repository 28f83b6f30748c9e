// Terrain and the outlines of smooth ground against dense sampling and closed forms.
#include "../../suite.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "../../study_car.h"
#include "hill.h"
#include "profile.h"
#include "rough.h"
#include "scene_terrain.h"
#include "track_terrain.h"

using namespace foldcar;

namespace {

constexpr double kAllowed_m = 0.00025;
const BodySpec kBody = study_car(0.115);

double height_of(const Profile& profile, double s_m) {
  for (const ProfileSegment& segment : profile) {
    if (segment.s0_m <= s_m && s_m <= segment.s1_m) {
      return segment.z0_m + (segment.z1_m - segment.z0_m) * (s_m - segment.s0_m) / (segment.s1_m - segment.s0_m);
    }
  }
  TEST_FAIL_MESSAGE("the profile has a gap");
  return 0;
}

// The highest of the surface, lowered by tilt times what is across, on a line over the car's frame at s.
double highest_m(const Terrain& terrain, const CutPose& pose, double s_m, const LateralSpan& across) {
  const double c = std::cos(pose.frame.heading_rad), s = std::sin(pose.frame.heading_rad);
  constexpr int kSamples = 100;
  double highest = -1e9;
  for (int i = 0; i <= kSamples; ++i) {
    const double across_m = across.from_m + (across.to_m - across.from_m) * i / kSamples;
    const double y_m = across.middle_m + across.scale * across_m;
    const double z_m = terrain.height_m(pose.frame.x_m + c * s_m - s * y_m, pose.frame.y_m + s * s_m + c * y_m);
    highest = std::max(highest, z_m - across.tilt * across_m);
  }
  return highest;
}

LateralSpan under_wheels(int k, double q) {
  const double half_m = 0.5 * kBody.wheels[0].width_m, side = k == 0 ? 0.5 : -0.5;
  const double cosine = std::sqrt(1 - q * q);
  return {-half_m, half_m, side * kBody.track_m * cosine, cosine, q};
}

// How far outlines of wheels are from the dense samples.
double wheel_error_m(const Terrain& terrain, const TrackTerrain& cut, const CutPose& pose) {
  double worst_m = 0;
  for (int k = 0; k < 2; ++k) {
    for (double s_m = -0.13; s_m <= 0.13; s_m += 0.00071) {
      const double expected_m = highest_m(terrain, pose, s_m, under_wheels(k, pose.q));
      worst_m = std::max(worst_m, std::abs(height_of(cut.profile(k), s_m) - expected_m));
    }
  }
  return worst_m;
}

// The worst over many places and headings around the terrain's middle.
double worst_wheel_error_m(const TerrainSpec& spec) {
  const SceneTerrain terrain(spec);
  std::mt19937 random(1);
  auto uniform = [&](double range) { return range * (static_cast<double>(random()) / 0x1p31 - 1); };
  double worst_m = 0;
  for (int i = 0; i < 30; ++i) {
    const CutPose pose{{uniform(0.15), uniform(0.15), uniform(3.1)}, 0.3 * i, uniform(0.2)};
    TrackTerrain cut(*terrain.ground(), kBody, CarConstants(kBody));
    cut.cut(pose);
    worst_m = std::max(worst_m, wheel_error_m(terrain, cut, pose));
  }
  return worst_m;
}

TerrainSpec hills_and_hollows() {
  TerrainSpec spec;
  spec.hills = {{0.05, 0.02, 0.3, 0.08, 0.05, 0.03}, {-0.1, -0.05, -1.1, 0.04, 0.1, 0.02}, {0.0, 0.1, 0, 0.06, 0.06, -0.025}};
  return spec;
}

TerrainSpec rough_ground(int seed) {
  TerrainSpec spec;
  spec.roughs = {{0.02, -0.01, 0.4, 0.7, 0.6, 0.003, 0.02, seed}};
  return spec;
}

}  // namespace

TEST(test_outlines_of_each_field_and_of_all_at_once_are_those_of_the_surface) {
  TerrainSpec potholes, all = hills_and_hollows();
  potholes.potholes = {{0.03, 0.02, 0.05, 0.02, 0.02}, {-0.09, -0.06, 0.08, 0.015, 0.08}, {0.05, -0.05, 0.04, 0.01, 0.012}};
  all.roughs = rough_ground(6).roughs;
  all.potholes = {{0.1, 0.0, 0.06, 0.02, 0.03}};
  for (const TerrainSpec& spec : {hills_and_hollows(), potholes, rough_ground(5), all}) {
    TEST_ASSERT_DOUBLE_WITHIN(kAllowed_m, 0, worst_wheel_error_m(spec));
  }
}

// A car that drives, turns and drifts cuts anew with what was planned for an earlier place.
TEST(test_outlines_stay_right_while_the_car_drives) {
  TerrainSpec spec = hills_and_hollows();
  spec.roughs = rough_ground(7).roughs;
  const SceneTerrain terrain(spec);
  TrackTerrain cut(*terrain.ground(), kBody, CarConstants(kBody));
  for (int i = 0; i < 60; ++i) {
    const CutPose pose{{-0.2 + 0.006 * i, 0.02 * std::sin(0.2 * i), 0.15 * std::cos(0.15 * i)}, 0.0062 * i, 0.001 * i};
    cut.cut(pose);
    TEST_ASSERT_DOUBLE_WITHIN(kAllowed_m, 0, wheel_error_m(terrain, cut, pose));
  }
}

TEST(test_a_rolled_belly_meets_the_ground_lowered_across_it) {
  const SceneTerrain terrain(hills_and_hollows());
  for (const double q : {0.0, 0.15, -0.3}) {
    TrackTerrain cut(*terrain.ground(), kBody, CarConstants(kBody));
    const CutPose pose{{-0.03, 0.02, 0.5}, 1.0, q};
    cut.cut(pose);
    const double cosine = std::sqrt(1 - q * q), half_m = 0.5 * kBody.segments[0].width_m;
    const double drop_m = CarConstants(kBody).belly_clearance_m;
    for (double s_m = -0.1; s_m <= 0.1; s_m += 0.0011) {
      const double expected_m = highest_m(terrain, pose, s_m, {-half_m, half_m, -drop_m * q, cosine, q});
      TEST_ASSERT_DOUBLE_WITHIN(kAllowed_m, expected_m, height_of(cut.profile(2), s_m));
    }
  }
}

TEST(test_a_hill_is_the_gaussian_of_its_distances) {
  TerrainSpec spec;
  spec.hills = {{0.4, -0.2, 0.7, 0.09, 0.05, 0.04}};
  const SceneTerrain terrain(spec);
  for (double along_m = -0.34; along_m < 0.35; along_m += 0.017) {
    for (double across_m = -0.19; across_m < 0.2; across_m += 0.013) {
      const double x_m = 0.4 + along_m * std::cos(0.7) - across_m * std::sin(0.7);
      const double y_m = -0.2 + along_m * std::sin(0.7) + across_m * std::cos(0.7);
      const double r2 = std::pow(along_m / 0.09, 2) + std::pow(across_m / 0.05, 2);
      TEST_ASSERT_DOUBLE_WITHIN(1e-6, r2 < 16 ? 0.04 * std::exp(-r2 / 2) : 0, terrain.height_m(x_m, y_m));
    }
  }
}

TEST(test_fields_add_up_and_the_highest_of_them_and_the_blocks_counts) {
  TerrainSpec spec;
  spec.hills = {{0, 0, 0, 0.1, 0.1, 0.03}, {0, 0, 0, 0.1, 0.1, 0.01}};
  spec.potholes = {{0, 0, 0.05, 0.015, 0.02}, {1, 0, 0.05, 0.015, 0.02}};
  spec.blocks = {{0, 0, 0.01, 0.01, 0.02, 0}, {1, 0, 0.01, 0.01, 0.005, 0}};
  const SceneTerrain terrain(spec);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.03 + 0.01 - 0.015, terrain.height_m(0, 0));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.005, terrain.height_m(1, 0));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.015, terrain.height_m(1, 0.01));
  // Half way down the wall half the depth.
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -0.0075, terrain.height_m(1, 0.04));
  TEST_ASSERT_EQUAL_DOUBLE(0, terrain.height_m(1, 0.05));
}

// A ramp with a plateau, turned and placed as scenes are, rounded to 1e-9, has no slit at its joints.
TEST(test_between_blocks_that_adjoin_there_is_no_slit) {
  const auto rounded = [](double value) { return std::round(value * 1e9) / 1e9; };
  std::mt19937 random(1);
  for (int place = 0; place < 200; ++place) {
    const double heading_rad = place == 0 ? -3.141592653 : 1e-4 * (static_cast<double>(random() % 62832) - 31416);
    const double c = std::cos(heading_rad), s = std::sin(heading_rad);
    const auto at = [&](double along_m, double length_m, double turn_rad, BlockSpec::Kind kind) {
      return BlockSpec{rounded(2 + c * along_m), rounded(s * along_m), length_m, 0.6, 0.06, rounded(heading_rad + turn_rad), kind};
    };
    TerrainSpec spec;
    spec.blocks = {at(-0.25, 0.2, 0, BlockSpec::Kind::kRamp), at(0, 0.3, 0, BlockSpec::Kind::kBox),
                   at(0.2, 0.1, M_PI, BlockSpec::Kind::kRamp)};
    const SceneTerrain terrain(spec);
    for (double across_m = -0.29; across_m < 0.295; across_m += 0.01) {
      for (const double joint_m : {-0.15, 0.15}) {
        for (const double off_m : {-1e-10, 0.0, 1e-10}) {
          const double along_m = joint_m + off_m;
          const double z_m = terrain.height_m(2 + c * along_m - s * across_m, s * along_m + c * across_m);
          TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.06, z_m);
        }
      }
    }
  }
}

TEST(test_a_tyre_bridges_a_hole_narrower_than_itself) {
  for (const double radius_m : {0.005, 0.03}) {
    TerrainSpec spec;
    spec.potholes = {{0, 0.5 * kBody.track_m, radius_m, 0.01, 0.002}};
    const SceneTerrain terrain(spec);
    TrackTerrain cut(*terrain.ground(), kBody, CarConstants(kBody));
    cut.cut({{0, 0, 0}, 0, 0});
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, radius_m < 0.006 ? 0 : -0.01, height_of(cut.profile(0), 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, height_of(cut.profile(1), 0));
  }
}

TEST(test_rough_ground_has_the_spread_and_the_correlation_asked_for) {
  const double sd_m = 0.004, correlation_m = 0.02;
  const Rough rough({0, 0, 0.3, 2.5, 2.5, sd_m, correlation_m, 17});
  // Means over many products, sampled two correlation lengths apart inside the fading edge: about 3,300 that hardly
  // depend on each other.
  auto product_mean = [&](double lag_m, double direction_rad) {
    double sum = 0;
    int count = 0;
    for (double x_m = -0.9; x_m < 0.9; x_m += 2 * correlation_m) {
      for (double y_m = -0.75; y_m < 0.75; y_m += 2 * correlation_m) {
        sum += rough.height_m(x_m, y_m) *
               rough.height_m(x_m + lag_m * std::cos(direction_rad), y_m + lag_m * std::sin(direction_rad));
        ++count;
      }
    }
    return sum / count;
  };
  const double variance = sd_m * sd_m, bound = 4 * std::sqrt(2.0 / 1700) * variance;
  for (const double direction_rad : {0.0, 0.8, 1.9}) {
    for (const double lag_m : {0.0, 0.005, 0.01, 0.02, 0.03, 0.06}) {
      const double expected = variance * std::exp(-lag_m * lag_m / (2 * correlation_m * correlation_m));
      TEST_ASSERT_DOUBLE_WITHIN(bound, expected, product_mean(lag_m, direction_rad));
    }
  }
}

TEST(test_rough_ground_depends_on_its_seed_alone_and_ends_at_its_edge) {
  const RoughSpec spec{0.2, 0.1, 0.5, 0.6, 0.4, 0.004, 0.03, 3};
  RoughSpec other = spec;
  other.seed = 4;
  const Rough first(spec), again(spec), another(other);
  double difference_m = 0;
  for (double x_m = -0.2; x_m < 0.6; x_m += 0.0013) {
    TEST_ASSERT_TRUE(first.height_m(x_m, 0.1) == again.height_m(x_m, 0.1));
    difference_m = std::max(difference_m, std::abs(first.height_m(x_m, 0.1) - another.height_m(x_m, 0.1)));
  }
  TEST_ASSERT_TRUE(difference_m > 0.004);
  const double c = std::cos(0.5), s = std::sin(0.5);
  for (double along_m = -0.299; along_m < 0.3; along_m += 0.007) {
    for (const double across_m : {-0.1999999, 0.1999999, 0.2000001}) {
      const double z_m = first.height_m(0.2 + c * along_m - s * across_m, 0.1 + s * along_m + c * across_m);
      TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, z_m);
    }
  }
}

TEST(test_the_last_patch_that_covers_a_point_sets_its_friction) {
  TerrainSpec spec;
  spec.patches = {{0, 0, 0, 1, 1, 0.2}, {0.3, 0, 0.785, 0.4, 0.1, 0.9}};
  const SceneTerrain terrain(spec);
  TEST_ASSERT_EQUAL_DOUBLE(0.2, terrain.friction(0, 0, 0.6));
  TEST_ASSERT_EQUAL_DOUBLE(0.9, terrain.friction(0.4, 0.1, 0.6));
  TEST_ASSERT_EQUAL_DOUBLE(0.2, terrain.friction(0.4, -0.1, 0.6));
  TEST_ASSERT_EQUAL_DOUBLE(0.6, terrain.friction(0.6, 0.45, 0.6));
  TEST_ASSERT_EQUAL_DOUBLE(0, terrain.height_m(0, 0));
}
