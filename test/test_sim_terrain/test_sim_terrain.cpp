// Terrain and outlines: slices of boxes against point sampling, the upper envelope against its definition.
#include <unity.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "scene_terrain.h"
#include "profile.h"

using namespace foldcar;

void setUp() {}
void tearDown() {}

namespace {

constexpr Span kSpan{-0.4, 0.4};
constexpr double kResolution_m = 0.00075;

double height_of(const std::vector<BoxSpec>& boxes, double x_m, double y_m) {
  double height_m = 0;
  for (const BoxSpec& box : boxes) {
    const double dx = x_m - box.x_m, dy = y_m - box.y_m;
    const double along = dx * std::cos(box.heading_rad) + dy * std::sin(box.heading_rad);
    const double across = dy * std::cos(box.heading_rad) - dx * std::sin(box.heading_rad);
    if (std::abs(along) <= box.length_m / 2 && std::abs(across) <= box.width_m / 2) {
      height_m = std::max(height_m, box.height_m);
    }
  }
  return height_m;
}

double height_of(const Profile& profile, double s_m) {
  for (const ProfileSegment& segment : profile) {
    if (segment.s0_m <= s_m && s_m <= segment.s1_m) {
      return segment.z0_m + (segment.z1_m - segment.z0_m) * (s_m - segment.s0_m) / (segment.s1_m - segment.s0_m);
    }
  }
  TEST_FAIL_MESSAGE("the profile has a gap");
  return 0;
}

Profile envelope(const std::vector<Piece>& pieces) {
  std::vector<double> scratch;
  Profile profile;
  upper_envelope(pieces, {kSpan.s_min_m, kSpan.s_max_m, 0, 0, 0}, kSpan, kResolution_m, scratch, profile);
  return profile;
}

const std::vector<BoxSpec> kBoxes = {{0.10, 0.02, 0.20, 0.12, 0.030, 0.4},
                                     {-0.15, -0.05, 0.10, 0.30, 0.015, -0.7},
                                     {0.12, 0.00, 0.05, 0.05, 0.050, 1.2}};

}  // namespace

void test_a_slice_is_the_highest_of_the_surface_over_the_strip() {
  const BoxTerrain terrain(kBoxes);
  const SliceFrame frame{-0.02, 0.01, 0.3};
  const Strip strip{0.02, 0.032};
  std::vector<std::vector<Piece>> pieces(1);
  terrain.slice(frame, kSpan, {strip}, pieces);
  const Profile profile = envelope(pieces[0]);
  int compared = 0;
  for (double s_m = -0.39; s_m < 0.39; s_m += 0.0013) {
    auto highest_near = [&](double reach_m) {
      double height_m = 0;
      for (double ds_m = -reach_m; ds_m <= reach_m; ds_m += std::max(reach_m, 1e-9)) {
        for (int i = 0; i <= 60; ++i) {
          const double y_m = strip.y_min_m + (strip.y_max_m - strip.y_min_m) * i / 60;
          const double s = s_m + ds_m;
          height_m = std::max(height_m, height_of(kBoxes, frame.x_m + s * std::cos(0.3) - y_m * std::sin(0.3),
                                                  frame.y_m + s * std::sin(0.3) + y_m * std::cos(0.3)));
        }
        if (reach_m == 0) break;
      }
      return height_m;
    };
    // Beside an edge (within the resolution) either side may count.
    if (highest_near(0) != highest_near(0.001)) continue;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, highest_near(0), height_of(profile, s_m));
    ++compared;
  }
  TEST_ASSERT_GREATER_THAN_INT(500, compared);
}

void test_a_strip_beside_every_box_is_flat() {
  const BoxTerrain terrain(kBoxes);
  std::vector<std::vector<Piece>> pieces(1);
  terrain.slice({0, 0, 0}, kSpan, {{0.35, 0.36}}, pieces);
  TEST_ASSERT_EQUAL_UINT(0, pieces[0].size());
  const Profile profile = envelope(pieces[0]);
  TEST_ASSERT_EQUAL_UINT(1, profile.size());
  TEST_ASSERT_EQUAL_DOUBLE(0, profile[0].z0_m);
}

void test_the_envelope_has_no_gaps_and_covers_the_span() {
  const Profile profile = envelope({{-0.1, 0.1, 0.02, 0.02, 0}, {0.05, 0.2, 0.03, 0.03, 0}, {0.2003, 0.3, 0.01, 0.01, 0}});
  TEST_ASSERT_EQUAL_DOUBLE(kSpan.s_min_m, profile.front().s0_m);
  TEST_ASSERT_EQUAL_DOUBLE(kSpan.s_max_m, profile.back().s1_m);
  for (std::size_t i = 1; i < profile.size(); ++i) TEST_ASSERT_EQUAL_DOUBLE(profile[i - 1].s1_m, profile[i].s0_m);
}

void test_sloping_pieces_cross_where_their_lines_do() {
  const Profile profile = envelope({{-0.2, 0.2, 0.00, 0.04, 0}, {-0.2, 0.2, 0.03, 0.01, 0}});
  // 0.02 + 0.1 s = 0.02 - 0.05 s at s = 0.
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.02, height_of(profile, 0));
  for (double s_m = -0.199; s_m < 0.2; s_m += 0.007) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, std::max(0.02 + 0.1 * s_m, 0.02 - 0.05 * s_m), height_of(profile, s_m));
  }
}

void test_strips_at_the_same_height_share_a_segment() {
  const Profile profile = envelope({{-0.1, 0.1, 0.02, 0.02, -0.04}, {-0.1, 0.1, 0.02, 0.02, 0.03}});
  TEST_ASSERT_EQUAL_UINT(3, profile.size());
  TEST_ASSERT_EQUAL_DOUBLE(-0.04, profile[1].y_min_m);
  TEST_ASSERT_EQUAL_DOUBLE(0.03, profile[1].y_max_m);
}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_slice_is_the_highest_of_the_surface_over_the_strip);
  RUN_TEST(test_a_strip_beside_every_box_is_flat);
  RUN_TEST(test_the_envelope_has_no_gaps_and_covers_the_span);
  RUN_TEST(test_sloping_pieces_cross_where_their_lines_do);
  RUN_TEST(test_strips_at_the_same_height_share_a_segment);
  UNITY_END();
  return 0;
}
