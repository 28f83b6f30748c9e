// Contacts of tyres and bellies with blocks: heights at which they just touch against dense sampling of the terrain,
// normals and depths against closed forms.
#include "../../suite.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "../../study_car.h"
#include "belly_contacts.h"
#include "contact_search.h"
#include "scene_terrain.h"
#include "tyre_contacts.h"

using namespace foldcar;

namespace {

constexpr double kRadius_m = 0.06, kHalfWidth_m = 0.006, kSample_m = 0.0006;
constexpr double kAllowed_m = 0.0005;

struct Pose {
  Vec3 at;
  Rotation turn;
};

TerrainSpec three_blocks(BlockSpec::Kind kind) {
  return blocks({{0.05, 0.01, 0.12, 0.20, 0.030, 0.4, kind},
                 {-0.08, -0.05, 0.10, 0.30, 0.015, -0.7, kind},
                 {0.06, 0.00, 0.08, 0.05, 0.040, 1.2, kind}});
}

std::vector<Pose> poses(int count) {
  std::mt19937 random(1);
  auto uniform = [&](double range) { return range * (static_cast<double>(random()) / 0x1p31 - 1); };
  std::vector<Pose> found;
  for (int i = 0; i < count; ++i) {
    const Vec3 at{uniform(0.12), uniform(0.12), 0};
    const double heading_rad = uniform(3.1), pitch_rad = uniform(0.5), roll_rad = uniform(0.5);
    found.push_back({at, rotation_by({0, 0, heading_rad}) * rotation_by({0, pitch_rad, 0}) * rotation_by({roll_rad, 0, 0})});
  }
  return found;
}

// The height of the middle at which a part just touches, from samples of its lower surface.
double touching_m(const Terrain& terrain, const Pose& pose, const std::vector<Vec3>& surface) {
  double height_m = -1;
  for (const Vec3& point : surface) {
    const Vec3 at = pose.at + pose.turn.to_world(point);
    height_m = std::max(height_m, terrain.height_m(at.x, at.y) - at.z);
  }
  return height_m;
}

// The same from contacts, by bisection.
template <typename Part, typename Place>
double touching_m(const Terrain& terrain, const Place& place) {
  double low_m = 0, high_m = 0.3;
  while (high_m - low_m > 1e-6) {
    const double middle_m = 0.5 * (low_m + high_m);
    const Part part = place(middle_m);
    std::vector<Contact> contacts;
    add_level_ground_contacts(part, 0, {}, contacts);
    for (const Solid& solid : terrain.solids()) add_solid_contacts(part, solid, 0, {}, contacts);
    (contacts.empty() ? high_m : low_m) = middle_m;
  }
  return high_m;
}

// A part of its pose, at a height; on blocks of every kind, in many poses, contacts must tell the height that samples do.
template <typename Part, typename Place>
void stands_as_high_as_its_surface_touches(const std::vector<Vec3>& surface, const Place& place, double within_m) {
  for (const auto kind : {BlockSpec::Kind::kBox, BlockSpec::Kind::kRamp, BlockSpec::Kind::kHalfRound}) {
    const SceneTerrain terrain(three_blocks(kind));
    for (const Pose& pose : poses(25)) {
      const double found_m = touching_m<Part>(terrain, [&](double z_m) { return place(pose, z_m); });
      TEST_ASSERT_DOUBLE_WITHIN(within_m, touching_m(terrain, pose, surface), found_m);
    }
  }
}

Tyre tyre_at(const Vec3& centre, double roll_rad, double heading_rad = 0) {
  return {centre, (rotation_by({0, 0, heading_rad}) * rotation_by({roll_rad, 0, 0})).left, kRadius_m, kHalfWidth_m};
}

std::vector<Contact> contacts_of(const Tyre& tyre, const Solid& solid, double margin_m = 0.001) {
  std::vector<Contact> contacts;
  add_solid_contacts(tyre, solid, margin_m, {}, contacts);
  return contacts;
}

// A box of 0.4 m by 0.2 m and 0.03 m high with its right side in y = 0.
const Solid kBox = make_solid({0, 0.1, 0.4, 0.2, 0.03, 0, BlockSpec::Kind::kBox});

void assert_direction(const Vec3& expected, const Vec3& direction) {
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected.x, direction.x);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected.y, direction.y);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected.z, direction.z);
}

}  // namespace

TEST(test_a_tyre_stands_as_high_as_its_surface_touches) {
  std::vector<Vec3> surface;
  for (double y_m = -kHalfWidth_m; y_m <= kHalfWidth_m + 1e-9; y_m += 0.5 * kSample_m) {
    for (double angle_rad = 0; angle_rad < 6.2832; angle_rad += kSample_m / kRadius_m) {
      surface.push_back({kRadius_m * std::cos(angle_rad), y_m, kRadius_m * std::sin(angle_rad)});
    }
  }
  const auto place = [](const Pose& pose, double z_m) {
    return Tyre{{pose.at.x, pose.at.y, z_m}, pose.turn.left, kRadius_m, kHalfWidth_m};
  };
  stands_as_high_as_its_surface_touches<Tyre>(surface, place, kAllowed_m);
}

TEST(test_a_belly_lies_as_high_as_its_surface_touches) {
  const double half_m[3] = {0.1, 0.05, 0.025}, step_m = 2 * kSample_m;
  std::vector<Vec3> surface;
  for (double x_m = -half_m[0]; x_m <= half_m[0] + 1e-9; x_m += step_m) {
    for (double y_m = -half_m[1]; y_m <= half_m[1] + 1e-9; y_m += step_m) surface.push_back({x_m, y_m, -half_m[2]});
  }
  for (double z_m = -half_m[2]; z_m <= half_m[2]; z_m += step_m) {
    for (const double side : {-1.0, 1.0}) {
      for (double x_m = -half_m[0]; x_m <= half_m[0]; x_m += step_m) surface.push_back({x_m, side * half_m[1], z_m});
      for (double y_m = -half_m[1]; y_m <= half_m[1]; y_m += step_m) surface.push_back({side * half_m[0], y_m, z_m});
    }
  }
  const auto place = [&](const Pose& pose, double z_m) {
    return Belly{{pose.at.x, pose.at.y, z_m},
                 {pose.turn.forward, pose.turn.left, pose.turn.up},
                 {half_m[0], half_m[1], half_m[2]}};
  };
  // Samples beside a wall miss up to their distance times the surface's slope.
  stands_as_high_as_its_surface_touches<Belly>(surface, place, 3 * kAllowed_m);
}

// Upright, its left side 1 mm within the box, whose top is 0.03 m above the tyre's lowest point. Leaning to the right, the
// side's middle is 0.04 m along the tyre's own up above the box's edge, which presses into its left side.
TEST(test_a_tyre_beside_a_wall_or_under_an_edge_is_pushed_aside_along_its_axle) {
  const double deep_m = 0.001;
  for (const double roll_rad : {0.0, 0.4}) {
    const Rotation lean = rotation_by({roll_rad, 0, 0});
    Tyre tyre = tyre_at({0, deep_m - kHalfWidth_m, kRadius_m}, roll_rad);
    if (roll_rad > 0) tyre.centre = Vec3{0, 0, 0.03} + 0.04 * lean.up + (deep_m - kHalfWidth_m) * lean.left;
    const std::vector<Contact> contacts = contacts_of(tyre, kBox);
    TEST_ASSERT_TRUE(!contacts.empty());
    for (const Contact& contact : contacts) {
      assert_direction(-1 * lean.left, contact.normal);
      TEST_ASSERT_DOUBLE_WITHIN(1e-9, -deep_m, contact.gap_m);
    }
  }
}

// Where a turned tyre meets a step's edge with its rim, the normal is across the edge, whatever the heading.
TEST(test_a_turned_tyre_meets_a_steps_edge_across_the_edge) {
  const Solid step = make_solid({0.5, 0, 1, 2, 0.03, 0, BlockSpec::Kind::kBox});
  for (const double heading_rad : {0.1, 0.4, -0.6}) {
    bool met = false;
    for (double x_m = -0.1; x_m < 0 && !met; x_m += 1e-5) {
      for (const Contact& contact : contacts_of(tyre_at({x_m, 0, kRadius_m}, 0, heading_rad), step, 0)) {
        met = true;
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, contact.normal.y);
        TEST_ASSERT_TRUE(contact.normal.x < -0.5 && contact.normal.z > 0.1);
        TEST_ASSERT_DOUBLE_WITHIN(2e-5, 0, contact.gap_m);
      }
    }
    TEST_ASSERT_TRUE(met);
  }
}

// The deepest contacts remain, of equally deep ones those found first, in the order of finding: by counting, for each
// contact, those that come before it. Depths repeat often, and the 200th is one of many equal ones.
TEST(test_of_many_contacts_the_deepest_and_first_found_remain_in_order) {
  std::mt19937 random(3);
  for (const std::size_t count : {kMaxContacts - 1, kMaxContacts, kMaxContacts + 1, 5 * kMaxContacts}) {
    std::vector<Contact> contacts(count);
    for (std::size_t i = 0; i < count; ++i) {
      contacts[i].segment = i;
      contacts[i].gap_m = -0.0001 * static_cast<double>(random() % 7);
    }
    std::vector<std::size_t> expected;
    for (const Contact& contact : contacts) {
      const auto deeper = std::count_if(contacts.begin(), contacts.end(), [&](const Contact& other) {
        return other.gap_m < contact.gap_m || (other.gap_m == contact.gap_m && other.segment < contact.segment);
      });
      if (static_cast<std::size_t>(deeper) < kMaxContacts) expected.push_back(contact.segment);
    }
    keep_deepest(contacts);
    TEST_ASSERT_EQUAL(std::min(count, kMaxContacts), contacts.size());
    for (std::size_t i = 0; i < contacts.size(); ++i) TEST_ASSERT_EQUAL(expected[i], contacts[i].segment);
  }
}
