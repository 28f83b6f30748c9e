// A leaning car against closed forms: falling back on a tyre's edge, landing on the other side's wheels, and what a car
// in the air keeps.
#include "../../suite.h"

#include <cmath>
#include <vector>

#include "../../closed_forms.h"
#include "multibody_car.h"

using namespace foldcar;

namespace {

constexpr double kRadius_m = 0.06;

struct LeaningDrive : DriveOf<MultibodyCar, StepOptions> {
  using DriveOf::DriveOf;
  // The car's origin at that place, rolled by lean_rad, with the body at these rates: v of the origin (world), roll.
  void set(const Vec3& at_m, double lean_rad, const Vec3& velocity_m_s, double roll_rad_s) {
    CarDynamics& car_now = car.dynamics();
    car_now.position_m = at_m;
    car_now.turn = rotation_by({lean_rad, 0, 0});
    const Vec3 v = car_now.turn.to_body(velocity_m_s);
    car_now.velocity = {v.x, v.y, v.z, roll_rad_s, 0, 0};
    car_now.velocity.resize(car_now.size(), velocity_m_s.x / kRadius_m);
  }
  double roll_rate_rad_s() { return car.dynamics().velocity[3]; }
};

// Angular momentum about the centre of mass, in the world's axes, summed over the parts of a car without hinges.
Vec3 angular_momentum(const BodySpec& body, const CarDynamics& car) {
  struct Part {
    double mass_kg;
    Vec3 at_m, inertia_kg_m2;
    double spin_rad_s;
  };
  const SegmentSpec& chassis = body.segments[0];
  std::vector<Part> parts{
      {chassis.mass_kg,
       {chassis.com_x_m, chassis.com_y_m, chassis.com_z_m},
       {chassis.roll_inertia_kg_m2, chassis.pitch_inertia_kg_m2, chassis.yaw_inertia_kg_m2},
       0}};
  for (std::size_t i = 0; i < body.wheels.size(); ++i) {
    const WheelSpec& wheel = body.wheels[i];
    const double disc_m2 = wheel.radius_m * wheel.radius_m, width_m2 = wheel.width_m * wheel.width_m;
    const double across = wheel.mass_kg * (disc_m2 / 4 + width_m2 / 12), spin = wheel.mass_kg * disc_m2 / 2;
    const double y_m = (wheel.side == CarSide::kLeft ? 0.5 : -0.5) * body.track_m;
    parts.push_back({wheel.mass_kg, {wheel.x_m, y_m, 0}, {across, spin, across}, car.velocity[6 + i]});
  }
  double mass_kg = 0;
  Vec3 middle_m;
  for (const Part& part : parts) {
    mass_kg += part.mass_kg;
    middle_m = middle_m + part.mass_kg * part.at_m;
  }
  middle_m = (1 / mass_kg) * middle_m;
  const Vec3 rate{car.velocity[3], car.velocity[4], car.velocity[5]};
  Vec3 sum;
  for (const Part& part : parts) {
    const Vec3 arm_m = part.at_m - middle_m, &inertia = part.inertia_kg_m2;
    sum = sum + part.mass_kg * cross(arm_m, cross(rate, arm_m)) +
          Vec3{inertia.x * rate.x, inertia.y * (rate.y + part.spin_rad_s), inertia.z * rate.z};
  }
  return car.turn.to_world(sum);
}

}  // namespace

// Thrown with all three rates it tumbles: in the world the angular momentum keeps its size and direction, and the energy
// stays, whatever the rates in its own axes do.
TEST(test_in_the_air_it_tumbles_with_constant_angular_momentum_and_energy) {
  LeaningDrive drive(study_car(0.08), scene_of({}, 0.6), kNoPulses);
  drive.set({0, 0, 2}, 0.3, {0.5, 0.2, 2.5}, 4);
  CarDynamics& car = drive.car.dynamics();
  car.velocity[4] = 3;
  car.velocity[5] = -2;
  const Vec3 start = angular_momentum(drive.body, car);
  const double size = std::sqrt(dot(start, start)), start_j = drive.car.mechanical_energy_j();
  const double rolled_rad_s = car.velocity[3], turned_rad_s = car.velocity[5];
  constexpr double kTime_s = 0.5;
  drive.run(kTime_s);
  const Vec3 change = angular_momentum(drive.body, car) - start;
  TEST_ASSERT_TRUE(std::abs(car.velocity[3] - rolled_rad_s) > 1 && std::abs(car.velocity[5] - turned_rad_s) > 1);
  TEST_ASSERT_DOUBLE_WITHIN(0.01 * size, 0, std::sqrt(dot(change, change)));
  // The integrator is ahead by half a step's worth of speed: it falls further than that speed tells.
  const double weight_n = CarConstants(drive.body).mass_kg * kGravity_m_s2;
  const double ahead_j = 0.5 * weight_n * kGravity_m_s2 * kTime_s * drive.step_s;
  TEST_ASSERT_DOUBLE_WITHIN(0.0005, start_j - ahead_j, drive.car.mechanical_energy_j());
}

TEST(test_it_falls_back_from_a_lean_in_the_time_of_a_rigid_body_on_its_edge) {
  for (const double side : {1.0, -1.0}) {
    const BodySpec body = study_car(0.08);
    const AcrossPlane plane(body);
    const double from_rad = 0.62, expected_s = plane.falling_back_s(from_rad);
    LeaningDrive drive(body, scene_of({}, 2), kNoPulses);
    drive.set({0, 0, kRadius_m * std::cos(from_rad) + plane.edge_m * std::sin(from_rad)}, side * from_rad, {}, 0);
    double taken_s = 0;
    while (side * drive.run(drive.step_s).roll_rad > 0.003 && taken_s < 1) taken_s += drive.step_s;
    TEST_ASSERT_DOUBLE_WITHIN(0.03 * expected_s, expected_s, taken_s);
  }
}

// The right wheels land, the left side up by φ, while it rolls on at 4 rad/s about its centre of mass at rest: an
// inelastic impact of a rigid body in the plane across it on the line of the tyres' outer edges, with friction, and then
// the motion on that line under gravity. Impulses (p, n) at the edge (y, z) change its velocities by the inverse mass
// matrix; where the edge would have to be held with more than μ n, it slides.
double roll_rate_after_landing_rad_s(const BodySpec& body, double lean_rad, double roll_rad_s, double friction,
                                     double time_s) {
  const AcrossPlane plane(body);
  const double a_m = plane.edge_m, m = plane.mass_kg, inertia = plane.inertia_kg_m2;
  constexpr double kStep_s = 1e-5;
  double side_m_s = 0, up_m_s = 0;
  for (double at_s = 0; at_s < time_s; at_s += kStep_s) {
    const double y = -a_m * std::cos(lean_rad) + plane.height_m * std::sin(lean_rad);
    const double z = -a_m * std::sin(lean_rad) - plane.height_m * std::cos(lean_rad);
    up_m_s -= kGravity_m_s2 * kStep_s;
    const double yy = 1 / m + z * z / inertia, zz = 1 / m + y * y / inertia, yz = -y * z / inertia;
    const double slip = side_m_s - z * roll_rad_s, rise = up_m_s + y * roll_rad_s;
    const double determinant = yy * zz - yz * yz;
    double p = -(zz * slip - yz * rise) / determinant, n = -(yy * rise - yz * slip) / determinant;
    if (std::abs(p) > friction * n) {
      const double share = std::copysign(friction, -slip);
      n = -rise / (zz + yz * share);
      p = share * n;
    }
    if (n > 0) {
      side_m_s += p / m;
      up_m_s += n / m;
      roll_rad_s += (y * n - z * p) / inertia;
    }
    lean_rad += roll_rad_s * kStep_s;
  }
  return roll_rad_s;
}

TEST(test_landing_on_a_leaning_sides_wheels_is_a_rigid_bodys_impact) {
  const BodySpec body = study_car(0.08);
  const AcrossPlane plane(body);
  const double a_m = plane.edge_m, before_rad_s = 4;
  for (const double friction : {0.3, 0.6, 10.0}) {
    for (const double lean_rad : {0.2, 0.5}) {
      for (const double time_s : {0.017, 0.034}) {
        const double expected = roll_rate_after_landing_rad_s(body, lean_rad, before_rad_s, friction, time_s);
        for (const double side : {1.0, -1.0}) {
          LeaningDrive drive(body, scene_of({}, friction), kNoPulses);
          const Vec3 up = rotation_by({side * lean_rad, 0, 0}).up;
          const Vec3 velocity = cross({-side * before_rad_s, 0, 0}, (plane.height_m - kRadius_m) * up);
          drive.set({0, 0, kRadius_m * std::cos(lean_rad) + a_m * std::sin(lean_rad)}, side * lean_rad, velocity,
                    side * before_rad_s);
          drive.run(time_s);
          // A tenth of the change that the impact makes, which takes up to four steps.
          TEST_ASSERT_DOUBLE_WITHIN(0.1 * before_rad_s, expected, side * drive.roll_rate_rad_s());
        }
      }
    }
  }
}
