#include "mujoco_car.h"

#include <algorithm>
#include <cmath>

#include "elementary_functions.h"
#include "plain_quaternion.h"

namespace foldcar {
namespace {

// Accuracy of the lowest height at which the car touches nothing, and how far above that it starts.
constexpr double kHeightTolerance_m = 1e-5;
constexpr double kDrop_m = 5e-4;

// The deeper a contact, the less of its slip's lift is removed: all of it at depth 0, nothing from this depth on.
constexpr double kLiftDepth_m = 3e-3;

constexpr double kTurn_rad = 2 * 3.14159265358979323846;

// Upper bound of the ground's height in the scene.
double highest_ground_m(const SceneSpec& scene) {
  double height_m = 0;
  for (const BlockSpec& block : scene.terrain.blocks) height_m = std::max(height_m, block.height_m);
  double smooth_m = 0;
  for (const HillSpec& hill : scene.terrain.hills) smooth_m += std::max(0.0, hill.height_m);
  // Six standard deviations of random heights are not exceeded.
  for (const RoughSpec& rough : scene.terrain.roughs) smooth_m += 6 * rough.height_sd_m;
  return std::max(height_m, smooth_m);
}

// Lower bound of the ground's height in the scene.
double lowest_ground_m(const SceneSpec& scene) {
  double depth_m = 0;
  for (const HillSpec& hill : scene.terrain.hills) depth_m -= std::min(0.0, hill.height_m);
  for (const PotholeSpec& pothole : scene.terrain.potholes) depth_m += pothole.depth_m;
  for (const RoughSpec& rough : scene.terrain.roughs) depth_m += 6 * rough.height_sd_m;
  return -depth_m;
}

}  // namespace

// Coulomb's law for contacts that slip.
//
// MuJoCo solves for contact accelerations a (normal n, tangential t) and forces f with a convex cost: in a contact
// that slips, R f_n = r_n - a_n + μ |a_t - r_t| and |f_t| = μ f_n, with the reference accelerations r_n = -b v_n - k d
// and r_t = -b v_t of velocities v and gap d, and the regularisation R. The last term of the first equation is no part
// of Coulomb's law: with b = 420/s a tyre that spins at v_t = 0.7 m/s on a friction of 0.6 is pushed off the ground at
// 18 g, and hammers it. As |a_t| is small beside b |v_t|, r_n - μ |r_t| in place of r_n removes the term. Where
// friction ends the slip within a step, |a_t - r_t| is smaller than |r_t| and the contact becomes too soft; therefore
// the removed share falls from 1 at the surface to 0 at a depth of kLiftDepth_m. A contact that holds has r_t close to
// 0 and does not change.
void cancel_lift_of_slip(mjData& data) {
  for (int i = 0; i < data.ncon; ++i) {
    const mjContact& contact = data.contact[i];
    if (contact.efc_address < 0) continue;
    double* reference = data.efc_aref + contact.efc_address;
    const double share = std::max(0.0, 1 + contact.dist / kLiftDepth_m);
    reference[0] -= share * contact.friction[0] * hypotenuse(reference[1], reference[2]);
  }
}

MujocoCar::MujocoCar(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                     const MujocoOptions& options, Stopwatch* stopwatch)
    : body_(body),
      scene_(scene),
      terrain_(terrain),
      stopwatch_(stopwatch),
      built_(build_mujoco_model(body, scene, terrain, options)),
      data_(mj_makeData(built_.model.get())),
      supply_(body) {
  const ScopedTimer timer(stopwatch_ != nullptr ? &stopwatch_->terrain_s : nullptr);
  place_on_ground();
  drive_wheels({});
  take_friction();
  mj_step1(built_.model.get(), data_.get());
  cancel_lift_of_slip(*data_);
  update_state();
}

// Puts the car at the start, level, just above the lowest height at which nothing touches. The height is found by
// bisection with MuJoCo's own collisions.
void MujocoCar::place_on_ground() {
  mjModel* model = built_.model.get();
  data_->qpos[0] = scene_.start.x_m;
  data_->qpos[1] = scene_.start.y_m;
  set_heading(data_->qpos + 3, scene_.start.heading_rad);
  double depth_m = 0;  // how far the car reaches below its origin
  for (const WheelSpec& wheel : body_.wheels) {
    // Where a tyre leans, the edge that is lower.
    const double edge_m = 0.5 * wheel.width_m * std::abs(sine(wheel.camber_rad));
    depth_m = std::max(depth_m, wheel.radius_m + wheel.eccentricity_m + edge_m);
  }
  for (const SegmentSpec& part : body_.segments) depth_m = std::max(depth_m, 0.5 * part.height_m - part.center_z_m);
  double low_m = lowest_ground_m(scene_) - 0.01, high_m = depth_m + highest_ground_m(scene_) + 0.01;
  while (high_m - low_m > kHeightTolerance_m) {
    const double middle_m = 0.5 * (low_m + high_m);
    data_->qpos[2] = middle_m;
    mj_kinematics(model, data_.get());
    mj_comPos(model, data_.get());
    mj_collision(model, data_.get());
    const bool touches = std::any_of(data_->contact, data_->contact + data_->ncon,
                                     [](const mjContact& contact) { return contact.dist < 0; });
    (touches ? low_m : high_m) = middle_m;
  }
  data_->qpos[2] = high_m + kDrop_m;
}

// One step. mj_step2 ends MuJoCo's step with the forces prepared before, mj_step1 prepares the next one.
void MujocoCar::step(const PulsesUs& pulses_us) {
  if (pulses_us != pulses_us_ || body_.supply_resistance_ohm > 0) drive_wheels(pulses_us);
  if (terrain_.has_patches()) take_friction();
  {
    const bool timed = stopwatch_ != nullptr && steps_++ % kTimedStepInterval == 0;
    const ScopedTimer timer(timed ? &stopwatch_->physics_s : nullptr, kTimedStepInterval);
    // In this order positions, contacts and what follows from them are those at the end of the step.
    mj_step2(built_.model.get(), data_.get());
    mj_step1(built_.model.get(), data_.get());
    cancel_lift_of_slip(*data_);
  }
  count_energy();
  update_state();
}

// Sets each driven wheel's actuator to its servo's torque line: torque = fraction · stall - slope · rate, within ±
// stall. The fraction of full power comes from the pulse; without pulses (not powered) the torque is 0.
void MujocoCar::drive_wheels(const PulsesUs& pulses_us) {
  pulses_us_ = pulses_us;
  for (std::size_t i = 0; i < body_.wheels.size(); ++i) {
    if (!body_.wheels[i].driven()) continue;
    const int k = built_.actuator[i];
    const ServoSpec& servo = body_.wheels[i].servo;
    const ServoDrive drive = servo_drive(servo, pulses_us[static_cast<std::size_t>(body_.wheels[i].channel)]);
    const double stall_n_m = servo.stall_torque_n_m * (supply_.voltage_v() / servo.rated_v);
    built_.model->actuator_gainprm[k * mjNGAIN] = drive.powered ? stall_n_m : 0;
    built_.model->actuator_forcerange[2 * k] = -stall_n_m;
    built_.model->actuator_forcerange[2 * k + 1] = stall_n_m;
    // Both of the line's ends are proportional to the voltage, its slope is not.
    built_.model->actuator_biasprm[k * mjNBIAS + 2] =
        drive.powered ? -servo.stall_torque_n_m / servo.no_load_speed_rad_s : 0;
    data_->ctrl[k] = drive.fraction;
  }
}

// Sets the friction of every tyre and belly: its grip times the ground's friction below its middle.
void MujocoCar::take_friction() {
  mjModel& model = *built_.model;
  const auto take = [&](int geom, double grip) {
    const double* at = data_->geom_xpos + 3 * geom;
    model.geom_friction[3 * geom] = grip * terrain_.friction(at[0], at[1], scene_.friction);
  };
  for (std::size_t i = 0; i < body_.wheels.size(); ++i) take(built_.tyre[i], body_.wheels[i].grip);
  for (std::size_t i = 0; i < body_.segments.size(); ++i) take(built_.belly[i], body_.segments[i].grip);
}

// Adds one step's work at the wheels and energy drawn from the battery.
void MujocoCar::count_energy() {
  const double step_s = built_.model->opt.timestep;
  for (std::size_t i = 0; i < body_.wheels.size(); ++i) {
    if (!body_.wheels[i].driven()) continue;
    const ServoSpec& servo = body_.wheels[i].servo;
    const ServoDrive drive = servo_drive(servo, pulses_us_[static_cast<std::size_t>(body_.wheels[i].channel)]);
    const double torque_n_m = data_->actuator_force[built_.actuator[i]];
    state_.motor_work_j += torque_n_m * wheel_speed_rad_s(i) * step_s;
    state_.consumed_energy_j += supply_.draw(servo_current_a(servo, drive, torque_n_m)) * step_s;
  }
  supply_.end_step();
}

// Reads the main segment's pose and velocity from MuJoCo (xmat: rotation matrix by rows). The heading counts whole
// turns.
void MujocoCar::update_state() {
  const int origin = built_.segment[main_segment(body_)];
  const double* at = data_->xpos + 3 * origin;
  const double* turn = data_->xmat + 9 * origin;
  state_.x_m = at[0];
  state_.y_m = at[1];
  state_.z_m = at[2];
  state_.heading_rad += std::remainder(arc_tangent(turn[3], turn[0]) - state_.heading_rad, kTurn_rad);
  state_.pitch_rad = arc_sine(std::clamp(turn[6], -1.0, 1.0));
  state_.roll_rad = arc_tangent(turn[7], turn[8]);
  state_.up = turn[8];
  double velocity[6];
  mj_objectVelocity(built_.model.get(), data_.get(), mjOBJ_XBODY, origin, velocity, 0);
  state_.speed_m_s = velocity[3] * cosine(state_.heading_rad) + velocity[4] * sine(state_.heading_rad);
  state_.yaw_rate_rad_s = velocity[2];
}

double MujocoCar::hinge_rad(std::size_t hinge) const { return data_->qpos[built_.hinge_position[hinge]]; }

double MujocoCar::wheel_speed_rad_s(std::size_t wheel) const { return data_->qvel[built_.wheel_velocity[wheel]]; }

double MujocoCar::mechanical_energy_j() {
  mj_energyPos(built_.model.get(), data_.get());
  mj_energyVel(built_.model.get(), data_.get());
  return data_->energy[0] + data_->energy[1];
}

// MuJoCo resets a simulation that diverges and counts it as a warning.
bool MujocoCar::finite() const {
  for (const int warning : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC, mjWARN_BADCTRL}) {
    if (data_->warning[warning].number > 0) return false;
  }
  return std::isfinite(state_.x_m) && std::isfinite(state_.y_m) && std::isfinite(state_.z_m) &&
         std::isfinite(state_.heading_rad) && std::isfinite(state_.up);
}

}  // namespace foldcar
