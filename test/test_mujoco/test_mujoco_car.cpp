// The three-dimensional car's physics against the closed forms that multibody is held to, and its ground against
// the heights of the terrain.
#include "../suite.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "../closed_form_tests.h"
#include "mujoco_car.h"
#include "mujoco_engine.h"
#include "mujoco_xml.h"
#include "trial.h"

using namespace foldcar;

namespace {

constexpr double kRadius_m = 0.06, kArm_m = 0.07;  // of the study car: wheels, half the distance of its axles

// A tyre's outer edge at its lowest, from the middle of the car's axle.
struct Edge {
  double aside_m, below_m;
};

Edge outer_edge(const BodySpec& body) {
  const WheelSpec& wheel = body.wheels[0];
  const double half_m = 0.5 * wheel.width_m, cosine = std::cos(wheel.camber_rad), sine = std::sin(wheel.camber_rad);
  return {0.5 * body.track_m + half_m * cosine - kRadius_m * sine, kRadius_m * cosine + half_m * sine};
}

BodySpec with_tyres(BodySpec body, double camber_rad, double contact_time_s = kContactTime_s) {
  for (WheelSpec& wheel : body.wheels) {
    wheel.camber_rad = camber_rad;
    wheel.contact_time_s = contact_time_s;
  }
  return body;
}

struct Drive : DriveOf<MujocoCar, MujocoOptions> {
  using DriveOf::DriveOf;
  // To be called after a change of data(): what follows from positions and velocities.
  void settle() { mj_step1(&car.model(), &car.data()); }
  // Rolled by that angle, on the outer edges of its right tyres.
  void lean(double lean_rad) {
    const Edge edge = outer_edge(body);
    double* at = car.data().qpos;
    at[2] = edge.below_m * std::cos(lean_rad) + edge.aside_m * std::sin(lean_rad);
    at[3] = std::cos(0.5 * lean_rad);
    at[4] = std::sin(0.5 * lean_rad);
    settle();
  }
};

double com_height_m(const BodySpec& body) {
  const SegmentSpec& segment = body.segments.front();
  return kRadius_m + segment.mass_kg * segment.com_z_m / mass_kg(body);
}

double ray_height_m(Drive& drive, double x_m, double y_m) {
  const double from[3] = {x_m, y_m, 2}, down[3] = {0, 0, -1};
  int geom = -1;
  double normal[3];
  return 2 - mj_ray(&drive.car.model(), &drive.car.data(), from, down, nullptr, 1, -1, &geom, normal);
}

// A car with its belly on a ridge, its front wheels in the air, its rear ones on the floor.
struct Hung {
  double ridge_x_m, height_m, length_m, friction;
};

// The drive of its rear wheels, which spin, against the ridge's edge that its belly lies on: the least friction of the
// belly that holds it, of the three equations of equilibrium in the plane.
double holding_friction(const BodySpec& body, const Hung& hung) {
  // The pitch at which the rear wheels touch the floor and the belly one of the edges, the other being below it.
  const double half_height_m = 0.5 * body.segments.front().height_m;
  const auto above_m = [&](double edge_x_m, double pitch_rad) {
    const double up_m = hung.height_m - kRadius_m - kArm_m * std::sin(pitch_rad);
    return up_m * std::cos(pitch_rad) - edge_x_m * std::sin(pitch_rad) + half_height_m;
  };
  double pitch_rad = 0, edge_x_m = 0;
  for (const double side : {-1.0, 1.0}) {
    const double x_m = hung.ridge_x_m + 0.5 * side * hung.length_m;
    double low_rad = 0, high_rad = 0.6;
    while (high_rad - low_rad > 1e-9) {
      const double middle_rad = 0.5 * (low_rad + high_rad);
      (above_m(x_m, middle_rad) > 0 ? low_rad : high_rad) = middle_rad;
    }
    if (low_rad > pitch_rad) {
      pitch_rad = low_rad;
      edge_x_m = x_m;
    }
  }
  const double sine = std::sin(pitch_rad), cosine = std::cos(pitch_rad), weight_n = mass_kg(body) * kGravity;
  const double com_x_m = -(com_height_m(body) - kRadius_m) * sine, wheel_x_m = -kArm_m * cosine;
  // Moments about the edge.
  const double load_n = weight_n * (com_x_m - edge_x_m) / (wheel_x_m - edge_x_m + hung.height_m * hung.friction);
  const double x_n = -hung.friction * load_n, z_n = weight_n - load_n;
  return -(x_n * cosine + z_n * sine) / (z_n * cosine - x_n * sine);
}

// How far (mm) its rear wheels drive it in 8 s.
double travel_mm(const Hung& hung, double belly_friction, double step_s) {
  BodySpec body = study_car(0.095);
  body.segments.front().grip = belly_friction / hung.friction;
  const TerrainSpec ridge = blocks({{hung.ridge_x_m, 0, hung.length_m, 0.08, hung.height_m, 0}});
  MujocoOptions options;
  options.step_s = step_s;
  Drive drive(body, scene_of(ridge, hung.friction), 0, options);
  const double start_m = drive.run(0.5).x_m;
  for (int percent = 1; percent <= 100; ++percent) {
    drive.pulses_us = pulses_for(body, 0.01 * percent);
    drive.run(0.02);
  }
  return 1e3 * (drive.run(8).x_m - start_m);
}

// A weak servo creeps against its soft contacts, and friction without slip does.
const Nearness<MujocoOptions> kNear{0.012, 0.0015, 0.008, false, 0.1, {}, true, {}};

}  // namespace

TEST_CLOSED_FORMS(Drive, kNear);

// Half a millimetre above what is under it, which the search for it finds to a hundredth, however high or low the
// ground is elsewhere.
TEST(test_it_is_put_down_on_the_ground_under_it) {
  TerrainSpec around, in_hole, in_hollow, on_hill;
  around.hills = {{2, 0.3, 0, 0.2, 0.2, 0.15}, {2, -0.5, 0, 0.1, 0.1, -0.1}};
  around.potholes = {{1.2, 0.5, 0.2, 0.08, 0.05}};
  around.roughs = {{2.5, 0, 0, 0.5, 0.5, 0.004, 0.05, 1}};
  in_hole = around;
  in_hole.potholes.push_back({0, 0, 0.5, 0.11, 0.05});
  in_hollow.hills = {{0, 0, 0, 10, 10, -0.1}};
  on_hill.hills = {{0, 0, 0, 10, 10, 0.1}};
  const TerrainSpec on_box = blocks({{0, 0, 1, 1, 0.09, 0}});
  for (const auto& [terrain, ground_m] : {std::pair(around, 0.0), std::pair(in_hole, -0.11), std::pair(in_hollow, -0.1),
                                          std::pair(on_hill, 0.1), std::pair(on_box, 0.09)}) {
    SceneSpec scene = scene_of(terrain, 0.6);
    scene.course = {-1, 3, -1, 1};
    const Drive drive(study_car(0.115), scene, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1.5e-4, kRadius_m + 5e-4 + ground_m, drive.car.state().z_m);
  }
}

// Standing across a side slope it slides from arctan μ on, then with g (sin - μ cos) on all its tyres.
TEST(test_it_slides_down_a_side_slope_from_the_friction_angle_on) {
  const double friction = 0.5;
  for (const double margin_deg : {-0.2, 0.3, 1.0}) {
    const double slope_rad = std::atan(friction) + margin_deg * kPi / 180;
    Drive drive(study_car(0.115), scene_of({}, friction), 0);
    drive.run(0.3);
    const double start_m = drive.car.state().y_m;
    mjModel& model = const_cast<mjModel&>(drive.car.model());
    model.opt.gravity[1] = -kGravity * std::sin(slope_rad);
    model.opt.gravity[2] = -kGravity * std::cos(slope_rad);
    drive.settle();
    const double accel = std::max(0.0, kGravity * (std::sin(slope_rad) - friction * std::cos(slope_rad)));
    const double expected_m = 0.5 * accel * 1.0 * 1.0;
    TEST_ASSERT_DOUBLE_WITHIN(0.05 * expected_m + 0.001, expected_m, start_m - drive.run(1).y_m);
  }
}

// Wheels that spin on the floor do not hammer a hung car free, and the step does not matter. Where its belly's friction
// is too low it moves on.
TEST(test_a_hung_belly_holds_where_statics_hold_it_at_every_step) {
  const BodySpec body = study_car(0.095);
  for (const Hung& hung : {Hung{0.055, 0.05, 0.03, 0.6}, Hung{0.05, 0.06, 0.02, 0.6}, Hung{0.07, 0.06, 0.03, 0.5}}) {
    const double holding = holding_friction(body, hung);
    TEST_ASSERT_TRUE(holding > 0.4 && holding < 0.5);
    const double sliding_mm = travel_mm(hung, 0.8 * holding, 5e-4);
    TEST_ASSERT_TRUE(sliding_mm > 15);
    for (const double step_s : {2e-3, 1e-3}) {
      TEST_ASSERT_DOUBLE_WITHIN(1, 0, travel_mm(hung, 1.35 * holding, step_s));
      TEST_ASSERT_DOUBLE_WITHIN(1, sliding_mm, travel_mm(hung, 0.8 * holding, step_s));
    }
  }
}

// A cylinder that leans stands on the lower of its edges: with its top inwards on the inner one.
TEST(test_a_leaning_tyre_stands_on_its_lower_edge) {
  for (const double camber_rad : {-0.035, -0.1, 0.05}) {
    const BodySpec body = with_tyres(study_car(0.095), camber_rad);
    const double half_m = 0.5 * body.wheels[0].width_m, sine = std::sin(camber_rad), cosine = std::cos(camber_rad);
    Drive drive(body, scene_of({}, 0.6), 0);
    TEST_ASSERT_DOUBLE_WITHIN(2e-4, kRadius_m * cosine + half_m * std::abs(sine), drive.run(0.5).z_m);
    const double aside_m = 0.5 * body.track_m - kRadius_m * sine + std::copysign(half_m * cosine, camber_rad);
    TEST_ASSERT_TRUE(drive.car.data().ncon >= 4);
    for (int i = 0; i < drive.car.data().ncon; ++i) {
      TEST_ASSERT_DOUBLE_WITHIN(2e-4, aside_m, std::abs(drive.car.data().contact[i].pos[1]));
    }
  }
}

// The lower edge is a wheel's radius from the axle, which stays level: no faster, and straight ahead even where all tops
// lean to the left. A contact in a point has no moment about its normal, so there is no camber thrust; within 1.3 m the car
// comes 2 mm nearer to where its tops lean.
TEST(test_leaning_tyres_roll_on_their_edges_straight_ahead) {
  const double camber_rad = 0.06;
  for (const double right_rad : {camber_rad, -camber_rad}) {
    BodySpec body = with_tyres(study_car(0.115), camber_rad);
    for (WheelSpec& wheel : body.wheels) {
      if (wheel.side == CarSide::kRight) wheel.camber_rad = right_rad;
    }
    Drive drive(body, scene_of({}, 0.6), 1);
    const CarState& state = drive.run(2);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, no_slip_speed_m_s(body, 0, 1), state.speed_m_s);
    TEST_ASSERT_DOUBLE_WITHIN(0.003, 0, state.y_m);
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0, state.heading_rad);
  }
}

// A contact at rest at depth p carries g: p = c T² (1 - d) / d², as MuJoCo's reference acceleration is -d p / (dmax T)² and
// its regularisation (1 - d) / d; d rises from 0.9 to 0.95 within the first millimetre. c is taken from the first T.
TEST(test_a_soft_tyre_sinks_by_the_square_of_its_contact_time) {
  double scale = 0;
  for (const double contact_time_s : {0.01, 0.02, 0.03}) {
    Drive drive(with_tyres(study_car(0.095), 0, contact_time_s), scene_of({}, 0.6), 0);
    const double depth_m = kRadius_m - drive.run(1).z_m, share = std::min(1.0, depth_m / 1e-3);
    const double rise = share < 0.5 ? 2 * share * share : 1 - 2 * (1 - share) * (1 - share);
    const double impedance = 0.9 + 0.05 * rise;
    const double expected = contact_time_s * contact_time_s * (1 - impedance) / (impedance * impedance);
    if (scale == 0) scale = depth_m / expected;
    TEST_ASSERT_TRUE(depth_m > 2e-5);
    TEST_ASSERT_DOUBLE_WITHIN(0.03 * depth_m, depth_m, scale * expected);
  }
}

// One side raised: it tips where its weight passes the outer edge of the other side's tyres, which camber moves.
TEST(test_it_tips_where_its_weight_passes_the_outer_tyre) {
  for (const auto& [width_m, camber_rad] :
       {std::pair(0.065, 0.0), std::pair(0.095, 0.0), std::pair(0.115, 0.0), std::pair(0.095, -0.1), std::pair(0.095, 0.1)}) {
    const BodySpec body = with_tyres(study_car(width_m), camber_rad);
    const Edge edge = outer_edge(body);
    const double limit_rad = std::atan(edge.aside_m / (com_height_m(body) - kRadius_m + edge.below_m));
    for (const double margin_rad : {-0.03, 0.03}) {
      // Standing on the right tyres' outer edges, leaning by that angle, at rest: it falls to either side.
      Drive drive(body, scene_of({}, 2), 0);
      const double lean_rad = limit_rad + margin_rad;
      drive.lean(lean_rad);
      const bool tipped = drive.run(1.5).up < 0.26;
      TEST_ASSERT_EQUAL_INT(margin_rad > 0, tipped);
    }
  }
}

TEST(test_it_falls_back_from_a_lean_in_the_time_of_a_rigid_body_on_its_edge) {
  const double from_rad = 0.62;
  Drive drive(study_car(0.08), scene_of({}, 2), 0);
  const double expected_s = AcrossPlane(drive.body).falling_back_s(from_rad);
  drive.lean(from_rad);
  double taken_s = 0;
  while (drive.run(drive.step_s).roll_rad > 0.003 && taken_s < 1) taken_s += drive.step_s;
  TEST_ASSERT_DOUBLE_WITHIN(0.03 * expected_s, expected_s, taken_s);
}

TEST(test_a_hinge_sags_as_its_stiffness_lets_it) {
  BodySpec body = hinged_study_car(0.095, 0.15);
  body.hinges[0].damping_n_m_s_rad = 0.003;
  Drive drive(body, scene_of({}, 0.6), kNoPulses);
  drive.run(3);
  const double sag_rad = HingedHalf(body).sag_rad();
  TEST_ASSERT_DOUBLE_WITHIN(0.03 * sag_rad, sag_rad, drive.car.hinge_rad(0));
}

// Blocks exactly, smooth ground within the grid's error.
TEST(test_the_ground_has_the_heights_of_the_terrain) {
  TerrainSpec terrain =
      blocks({{0, 0.1, 0.4, 0.3, 0.05, 0.5}, {1, 0.1, 0.2, 0.3, 0.04, 0.5}, {-1, 0, 0.2, 0.2, 0.03, 0.2}});
  terrain.blocks[0].kind = BlockSpec::Kind::kRamp;
  terrain.blocks[1].kind = BlockSpec::Kind::kHalfRound;
  Drive on_blocks(study_car(0.115), scene_of(terrain, 0.6, {-3, 0, 0}), 0);
  for (double x_m = -1.2; x_m < 1.3; x_m += 0.0137) {
    for (const double y_m : {-0.11, 0.02, 0.08, 0.17}) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-6, on_blocks.terrain.height_m(x_m, y_m), ray_height_m(on_blocks, x_m, y_m));
    }
  }
  TerrainSpec smooth;
  smooth.hills.push_back({0.4, 0.1, 0.3, 0.12, 0.08, 0.03});
  smooth.hills.push_back({-0.3, -0.2, 0, 0.1, 0.1, -0.02});
  SceneSpec scene = scene_of(smooth, 0.6, {-4, 0, 0});
  scene.course = {-1.5, 1.5, -1, 1};
  Drive on_hills(study_car(0.115), scene, 0);
  for (double x_m = -1.7; x_m < 1.7; x_m += 0.0731) {
    for (double y_m = -1.2; y_m < 1.2; y_m += 0.0613) {
      TEST_ASSERT_DOUBLE_WITHIN(2.5e-4, on_hills.terrain.height_m(x_m, y_m), ray_height_m(on_hills, x_m, y_m));
    }
  }
  TEST_ASSERT_DOUBLE_WITHIN(3e-4, kRadius_m, on_hills.run(0.3).z_m);
}

// The file has six digits of each number, so its model's are within half a unit of the sixth of the engine's.
void within_six_digits(const mjtNum* expected, const mjtNum* actual, int count) {
  for (int i = 0; i < count; ++i) {
    TEST_ASSERT_DOUBLE_WITHIN(5e-6 * std::abs(expected[i]) + 1e-12, expected[i], actual[i]);
  }
}

// Read by MuJoCo and stepped as the engine does, the saved file drives as the engine's car. They differ by rounding to
// six digits: lengths, speeds and times near 1 by up to 5e-7, so that on level ground the cars part by micrometres.
TEST(test_the_saved_model_runs_like_the_engine) {
  const BodySpec body = with_tyres(hinged_study_car(0.095, 0.6), -0.02, 0.006);
  const SceneSpec scene = scene_of(blocks({{0.4, 0, 0.06, 2, 0.01, 0}}), 0.6);
  Drive drive(body, scene, 1);
  const std::string xml = mujoco_xml(body, scene, drive.terrain, {}, "car");
  char error[500] = "";
  const std::unique_ptr<mjSpec, DeleteSpec> spec(mj_parseXMLString(xml.c_str(), nullptr, error, sizeof error));
  TEST_ASSERT_TRUE_MESSAGE(spec != nullptr, error);
  const std::unique_ptr<mjModel, DeleteModel> saved(mj_compile(spec.get(), nullptr));
  TEST_ASSERT_TRUE(saved != nullptr);
  const mjModel& built = drive.car.model();
  TEST_ASSERT_EQUAL_INT(built.nq, saved->nq);
  TEST_ASSERT_EQUAL_INT(built.nu, saved->nu);
  TEST_ASSERT_EQUAL_INT(built.ngeom, saved->ngeom);
  TEST_ASSERT_EQUAL_INT(built.opt.integrator, saved->opt.integrator);
  TEST_ASSERT_EQUAL_INT(built.opt.cone, saved->opt.cone);
  TEST_ASSERT_EQUAL_INT(built.opt.disableflags, saved->opt.disableflags);
  const std::unique_ptr<mjData, DeleteData> data(mj_makeData(saved.get()));
  mj_resetDataKeyframe(saved.get(), data.get(), 0);
  std::fill(data->ctrl, data->ctrl + saved->nu, 1.0);
  double apart_m = 0;
  while (drive.car.state().x_m < 0.25) {
    drive.run(drive.step_s);
    mj_step1(saved.get(), data.get());
    cancel_lift_of_slip(*data);
    mj_step2(saved.get(), data.get());
    const double* at = drive.car.data().qpos;
    apart_m = std::max(apart_m, std::hypot(at[0] - data->qpos[0], at[2] - data->qpos[2]));
  }
  within_six_digits(&built.opt.timestep, &saved->opt.timestep, 1);
  within_six_digits(&built.opt.impratio, &saved->opt.impratio, 1);
  within_six_digits(built.body_mass, saved->body_mass, built.nbody);
  within_six_digits(built.body_inertia, saved->body_inertia, 3 * built.nbody);
  within_six_digits(built.dof_armature, saved->dof_armature, built.nv);
  within_six_digits(built.jnt_range, saved->jnt_range, 2 * built.njnt);
  within_six_digits(built.geom_size, saved->geom_size, 3 * built.ngeom);
  within_six_digits(built.geom_pos, saved->geom_pos, 3 * built.ngeom);
  within_six_digits(built.geom_friction, saved->geom_friction, 3 * built.ngeom);
  within_six_digits(built.geom_solref, saved->geom_solref, mjNREF * built.ngeom);
  within_six_digits(built.actuator_gainprm, saved->actuator_gainprm, mjNGAIN * built.nu);
  within_six_digits(built.actuator_biasprm, saved->actuator_biasprm, mjNBIAS * built.nu);
  TEST_ASSERT_DOUBLE_WITHIN(2e-6, 0, apart_m);
}

// MuJoCo's actuators have one voltage.
TEST(test_a_supply_that_sags_is_no_saved_model) {
  BodySpec body = study_car(0.095);
  body.supply_resistance_ohm = 0.3;
  const SceneSpec scene = scene_of({}, 0.6);
  const SceneTerrain terrain(scene.terrain);
  bool refused = false;
  try {
    mujoco_xml(body, scene, terrain, {}, "car");
  } catch (const std::runtime_error& error) {
    refused = std::string(error.what()).find("supply_resistance_ohm") != std::string::npos;
  }
  TEST_ASSERT_TRUE(refused);
}

TEST(test_a_trial_runs_the_firmware_and_gives_the_same_numbers_again) {
  const MujocoEngine engine;
  const BodySpec body = study_car(0.115);
  const TrialResult first = run_trial(engine, body, pyramids(), full_speed(body));
  run_trial(engine, study_car(0.065), pyramids(), full_speed(body));
  const TrialResult again = run_trial(engine, body, pyramids(), full_speed(body));
  TEST_ASSERT_EQUAL_INT(static_cast<int>(first.outcome), static_cast<int>(again.outcome));
  TEST_ASSERT_EQUAL_DOUBLE(first.elapsed_time_s, again.elapsed_time_s);
  TEST_ASSERT_EQUAL_DOUBLE(first.consumed_energy_j, again.consumed_energy_j);
  TEST_ASSERT_EQUAL_DOUBLE(first.max_pitch_rad, again.max_pitch_rad);
  TEST_ASSERT_TRUE(first.max_pitch_rad > 0.05);
}
