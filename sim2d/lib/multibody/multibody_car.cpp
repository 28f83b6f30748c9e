#include "multibody_car.h"

#include <algorithm>
#include <cmath>

#include "elementary_functions.h"

namespace foldcar {
namespace {

// Largest sine of roll for which the terrain is cut; a car that far over has tipped.
constexpr double kMaxSinRoll = 0.95;
// Contacts are looked for this far from the car: what it moves in a step at 1 m/s.
constexpr double kMargin_m = 0.004;
// When the car is put down, its height is found this accurately.
constexpr double kRaster_m = 1e-6;
// A contact of the last step is the same if its normal differs by less than the angle of this cosine.
constexpr double kSameNormal = 0.9;

constexpr double kTurn_rad = 2 * 3.14159265358979323846;

}  // namespace

MultibodyCar::MultibodyCar(const BodySpec& body, double friction, const Terrain& terrain, const PoseSpec& start,
                           const StepOptions& options, Stopwatch* stopwatch)
    : body_(body),
      main_(main_segment(body)),
      friction_(friction),
      terrain_(terrain),
      constants_(body),
      step_s_(1 / options.rate_hz),
      stopwatch_(stopwatch),
      car_(body, step_s_),
      search_(body, constants_, terrain),
      solver_(make_contact_solver(body, step_s_, options.iterations)),
      torque_n_m_(body.wheels.size()),
      damping_(body.wheels.size()),
      start_rad_s_(body.wheels.size()),
      supply_(body) {
  check_plain_tyres(body, "multibody");
  if (terrain.ground() != nullptr) ground_.emplace(*terrain.ground(), body, constants_);
  place_on_ground(start, options.drop_m);
}

// Returns the lowest height (m) of the car's origin, in its present attitude, at which no contact that `counts`
// accepts overlaps the ground: lowered from above in coarse steps until one does, then by bisection.
template <typename Counts>
double MultibodyCar::lowest_m(const Counts& counts) {
  const auto overlaps = [&](double z_m) {
    car_.position_m.z = z_m;
    search_.find(car_, ground_ ? &*ground_ : nullptr, 0, contacts_);
    return std::any_of(contacts_.begin(), contacts_.end(), counts);
  };
  double high_m = search_.highest_m();
  if (ground_) {
    for (int outline = 0; outline < 3; ++outline) {
      for (const ProfileSegment& segment : ground_->profile(outline)) high_m = std::max(high_m, segment.z0_m);
    }
  }
  high_m += 2 * constants_.reach_m;
  double low_m = high_m;
  // Down by less than a wheel, which could otherwise be on either side of an outline.
  while (!overlaps(low_m)) {
    high_m = low_m;
    low_m -= 0.5 * constants_.wheel_radius_m;
  }
  while (high_m - low_m > kRaster_m) {
    const double middle_m = 0.5 * (low_m + high_m);
    (overlaps(middle_m) ? low_m : high_m) = middle_m;
  }
  return high_m;
}

// Puts the car down at the start's place and heading, rolled as the ground's heights under its two sides differ,
// drop_m above the lowest height without overlap.
void MultibodyCar::place_on_ground(const PoseSpec& start, double drop_m) {
  state_.heading_rad = start.heading_rad;
  const auto [s, c] = sine_and_cosine(start.heading_rad);
  const Rotation level = rotation_by({0, 0, start.heading_rad});
  const auto any = [](const Contact&) { return true; };
  car_.turn = level;
  car_.position_m = {start.x_m, start.y_m, 0};
  search_.find_near(car_.position_m);
  cut_terrain_if_stale();
  const auto on_side = [&](CarSide side) {
    return [this, side](const Contact& contact) {
      return contact.wheel >= 0 && body_.wheels[static_cast<std::size_t>(contact.wheel)].side == side;
    };
  };
  const double left_m = lowest_m(on_side(CarSide::kLeft)), right_m = lowest_m(on_side(CarSide::kRight));
  const double q = std::clamp((left_m - right_m) / body_.track_m, -kMaxSinRoll, kMaxSinRoll);
  car_.turn = level * rotation_by({arc_sine(q), 0, 0});
  // Roll about the contacts moves the axle line, a wheel's radius above them, to the lower side.
  const double aside_m = -constants_.wheel_radius_m * q;
  car_.position_m = {start.x_m - aside_m * s, start.y_m + aside_m * c, 0};
  cut_terrain_if_stale();
  car_.position_m.z = lowest_m(any) + drop_m;
  contacts_.clear();
  update_state();
  path_m_ = 0;
}

// Returns where to cut the terrain's outlines: the point on the ground below the main segment's centre of mass, seen
// along the car's up axis (hence the shift aside in a roll), with heading, distance driven and sine of roll.
CutPose MultibodyCar::cut_pose() const {
  const SegmentSpec& main = body_.segments[main_];
  const Rotation& turn = car_.turn;
  const double q = std::clamp(turn.left.z, -kMaxSinRoll, kMaxSinRoll);
  const Vec3 at = car_.position_m + turn.to_world(car_.place(main_, {main.com_x_m, 0, 0}));
  const double aside_m = constants_.wheel_radius_m * q;
  const auto [s, c] = sine_and_cosine(state_.heading_rad);
  return {{at.x - aside_m * s, at.y + aside_m * c, state_.heading_rad}, path_m_, q};
}

void MultibodyCar::cut_terrain_if_stale() {
  if (!ground_) return;
  const CutPose pose = cut_pose();
  if (!ground_->stale(pose)) return;
  const ScopedTimer timer(stopwatch_ != nullptr ? &stopwatch_->terrain_s : nullptr);
  ground_->cut(pose);
}

// One step: contacts at the present pose, servo torques, contact impulses, energy account, then the move.
void MultibodyCar::step(const PulsesUs& pulses_us) {
  cut_terrain_if_stale();
  const bool timed = stopwatch_ != nullptr && steps_++ % kTimedStepInterval == 0;
  {
    const ScopedTimer timer(timed ? &stopwatch_->terrain_s : nullptr, kTimedStepInterval);
    find_contacts();
  }
  {
    const ScopedTimer timer(timed ? &stopwatch_->physics_s : nullptr, kTimedStepInterval);
    drive_wheels(pulses_us);
    const std::vector<double>& moving = solver_->solve(car_, contacts_);
    count_energy(pulses_us);
    car_.move(moving);
  }
  update_state();
}

// Accelerates the car by the servos. A torque falls linearly with its wheel's rate; this fall enters as damping, which
// CarDynamics::accelerate takes at the end of the step.
void MultibodyCar::drive_wheels(const PulsesUs& pulses_us) {
  for (std::size_t i = 0; i < body_.wheels.size(); ++i) {
    const WheelSpec& spec = body_.wheels[i];
    const ServoDrive drive = servo_drive(spec.servo, pulses_us[static_cast<std::size_t>(spec.channel)]);
    start_rad_s_[i] = wheel_speed_rad_s(i);
    torque_n_m_[i] = servo_torque_n_m(spec.servo, drive, start_rad_s_[i], supply_.voltage_v());
    damping_[i] = drive.powered ? spec.servo.stall_torque_n_m / spec.servo.no_load_speed_rad_s : 0;
  }
  car_.accelerate(torque_n_m_, damping_);
}

// Adds one step's work at the wheels (torque times mean rate) and energy drawn from the battery.
void MultibodyCar::count_energy(const PulsesUs& pulses_us) {
  for (std::size_t i = 0; i < body_.wheels.size(); ++i) {
    const WheelSpec& spec = body_.wheels[i];
    const ServoDrive drive = servo_drive(spec.servo, pulses_us[static_cast<std::size_t>(spec.channel)]);
    const double end_rad_s = wheel_speed_rad_s(i);
    const double torque_n_m = torque_n_m_[i] - damping_[i] * (end_rad_s - start_rad_s_[i]);
    state_.motor_work_j += torque_n_m * 0.5 * (start_rad_s_[i] + end_rad_s) * step_s_;
    state_.consumed_energy_j += supply_.draw(servo_current_a(spec.servo, drive, torque_n_m)) * step_s_;
  }
  supply_.end_step();
}

// Finds the contacts of this step, with their friction. One that the last step had too (same part and place across,
// similar normal) starts from that one's impulses, from which the solver needs fewer passes, and continues its impact.
void MultibodyCar::find_contacts() {
  last_contacts_.swap(contacts_);
  search_.find(car_, ground_ ? &*ground_ : nullptr, kMargin_m, contacts_);
  for (Contact& contact : contacts_) {
    const double grip = contact.wheel >= 0 ? body_.wheels[static_cast<std::size_t>(contact.wheel)].grip
                                           : body_.segments[contact.segment].grip;
    contact.friction = grip * (terrain_.has_patches()
                                   ? terrain_.friction(contact.point_m.x, contact.point_m.y, friction_)
                                   : friction_);
    for (Contact& last : last_contacts_) {
      const bool same = last.wheel == contact.wheel && last.segment == contact.segment &&
                        last.across_m == contact.across_m && dot(last.normal, contact.normal) > kSameNormal;
      if (!same) continue;
      for (int k = 0; k < 3; ++k) contact.impulse_n_s[k] = last.impulse_n_s[k];
      contact.impact_steps = last.impact_steps;
      contact.approach_m_s = last.approach_m_s;
      last.wheel = -2;  // taken
      break;
    }
  }
}

// Computes the car's state from the dynamics: place, attitude and velocity of the main segment.
void MultibodyCar::update_state() {
  const double fold_rad = car_.fold_rad(main_);
  const Rotation turn = car_.turn * rotation_by({0, fold_rad, 0});
  const Vec3 at = car_.position_m + car_.turn.to_world(car_.place(main_, {}));
  const double heading_rad = arc_tangent(turn.forward.y, turn.forward.x);
  // The heading counts whole turns.
  const double change_rad = std::remainder(heading_rad - state_.heading_rad, kTurn_rad);
  const auto [s, c] = sine_and_cosine(heading_rad);
  const double along_m = (at.x - state_.x_m) * c + (at.y - state_.y_m) * s;
  path_m_ += along_m;
  state_.heading_rad += change_rad;
  state_.x_m = at.x;
  state_.y_m = at.y;
  state_.z_m = at.z;
  state_.pitch_rad = arc_sine(std::clamp(turn.forward.z, -1.0, 1.0));
  state_.roll_rad = arc_tangent(turn.left.z, turn.up.z);
  state_.up = turn.up.z;
  const std::vector<double>& u = car_.velocity;
  const Vec3 rate{u[3], u[4], u[5]};
  const Vec3 velocity = car_.turn.to_world(Vec3{u[0], u[1], u[2]} + cross(rate, car_.place(main_, {})));
  state_.speed_m_s = velocity.x * c + velocity.y * s;
  state_.yaw_rate_rad_s = car_.turn.to_world(rate).z;
}

double MultibodyCar::wheel_speed_rad_s(std::size_t wheel) const {
  return car_.velocity[6 + body_.hinges.size() + wheel];
}

double MultibodyCar::wheel_load_n(std::size_t wheel) const {
  double impulse_n_s = 0;
  for (const Contact& contact : contacts_) {
    if (contact.wheel == static_cast<int>(wheel)) impulse_n_s += contact.impulse_n_s[0];
  }
  return impulse_n_s / step_s_;
}

bool MultibodyCar::finite() const {
  return std::isfinite(state_.x_m) && std::isfinite(state_.y_m) && std::isfinite(state_.z_m) &&
         std::isfinite(state_.heading_rad) && std::isfinite(state_.up);
}

}  // namespace foldcar
