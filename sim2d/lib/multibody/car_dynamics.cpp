#include "car_dynamics.h"

#include <iterator>

#include "elementary_functions.h"

namespace foldcar {
namespace {

// Change of a hinge's angle over which the mass matrix is differentiated.
constexpr double kDifference_rad = 1e-5;

}  // namespace

CarDynamics::CarDynamics(const BodySpec& body, double step_s)
    : hinge_rad(body.hinges.size()),
      wheel_rad(body.wheels.size()),
      velocity(6 + body.hinges.size() + body.wheels.size()),
      body_(body),
      step_s_(step_s),
      hinges_(body.hinges.size()),
      wheels_(body.wheels.size()),
      size_(6 + hinges_ + wheels_),
      frames_(body.segments.size()),
      hinge_at_(hinges_),
      axle_(wheels_),
      mass_(size_),
      inverse_(size_),
      implicit_inverse_(size_),
      damping_(wheels_),
      force_(row_length(size_)),
      acceleration_(row_length(size_)),
      momentum_(row_length(size_)) {
  place_segments();
  fill_mass(mass_);
  update_inverses();
}

// Converts a segment's point from the drawing's coordinates to the first segment's axes: a turn by the segment's pitch
// about the left axis, then a shift.
Vec3 CarDynamics::place(std::size_t segment, const Vec3& point_m) const {
  const Frame& frame = frames_[segment];
  return {frame.x_m + frame.cosine * point_m.x + frame.sine * point_m.z, point_m.y,
          frame.z_m - frame.sine * point_m.x + frame.cosine * point_m.z};
}

// Updates the segments' frames, the hinges' and the axles' places from the hinges' angles, along the chain: each
// segment is turned about the hinge that joins it to the one before.
void CarDynamics::place_segments() {
  for (std::size_t i = 0; i < hinges_; ++i) {
    const HingeSpec& hinge = body_.hinges[i];
    hinge_at_[i] = place(i, {hinge.x_m, 0, hinge.z_m});
    Frame& next = frames_[i + 1];
    next.angle_rad = frames_[i].angle_rad + hinge_rad[i];
    const auto [sine, cosine] = sine_and_cosine(next.angle_rad);
    next.cosine = cosine;
    next.sine = sine;
    next.x_m = hinge_at_[i].x - next.cosine * hinge.x_m - next.sine * hinge.z_m;
    next.z_m = hinge_at_[i].z + next.sine * hinge.x_m - next.cosine * hinge.z_m;
  }
  for (std::size_t i = 0; i < wheels_; ++i) {
    const WheelSpec& wheel = body_.wheels[i];
    axle_[i] = place(static_cast<std::size_t>(wheel.segment),
                     {wheel.x_m, (wheel.side == CarSide::kLeft ? 0.5 : -0.5) * body_.track_m, 0});
  }
}

// Adds a rigid part (a segment or, if wheel >= 0, that wheel) to the mass matrix: M = Σ factor rowᵀ row, with row · u
// the velocity of its centre of mass along an axis and factor its mass, or the angular velocity about a principal axis
// and its moment there. inertia_kg_m2: the moments about the segment's forward, left and up axes.
void CarDynamics::add_part(double mass_kg, const Vec3& at_m, const Vec3& inertia_kg_m2, std::size_t segment, int wheel,
                           SquareMatrix& mass) const {
  double row[kMaxRowLength];
  const auto add = [&](double factor) {
    for (std::size_t j = 0; j < size_; ++j) {
      for (std::size_t i = 0; i < size_; ++i) mass.at(i, j) += factor * row[i] * row[j];
    }
  };
  for (const Vec3& axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
    jacobian(at_m, axis, segment, kNoWheel, row);
    add(mass_kg);
  }
  const Frame& frame = frames_[segment];
  const auto turning = [&](const Vec3& axis, double moment) {
    std::fill(std::begin(row), std::end(row), 0.0);
    row[3] = axis.x;
    row[4] = axis.y;
    row[5] = axis.z;
    if (axis.y != 0) {
      for (std::size_t i = 0; i < segment; ++i) row[6 + i] = 1;
      if (wheel >= 0) row[6 + hinges_ + static_cast<std::size_t>(wheel)] = 1;
    }
    add(moment);
  };
  turning({frame.cosine, 0, -frame.sine}, inertia_kg_m2.x);
  turning({0, 1, 0}, inertia_kg_m2.y);
  turning({frame.sine, 0, frame.cosine}, inertia_kg_m2.z);
}

// Computes the mass matrix for the hinges' present angles. A wheel is a uniform disc. The servo's rotor turns with the
// wheel through the gears. Its inertia, as felt at the wheel's shaft, resists only the wheel's rate relative to the
// segment; the segment feels no reaction.
void CarDynamics::fill_mass(SquareMatrix& mass) const {
  mass.clear();
  for (std::size_t j = 0; j < frames_.size(); ++j) {
    const SegmentSpec& part = body_.segments[j];
    add_part(part.mass_kg, place(j, {part.com_x_m, part.com_y_m, part.com_z_m}),
             {part.roll_inertia_kg_m2, part.pitch_inertia_kg_m2, part.yaw_inertia_kg_m2}, j, kNoWheel, mass);
  }
  for (std::size_t i = 0; i < wheels_; ++i) {
    const WheelSpec& wheel = body_.wheels[i];
    const double spin = 0.5 * wheel.mass_kg * wheel.radius_m * wheel.radius_m;
    const double across = 0.5 * spin + wheel.mass_kg * wheel.width_m * wheel.width_m / 12;
    add_part(wheel.mass_kg, axle_[i], {across, spin, across}, static_cast<std::size_t>(wheel.segment),
             static_cast<int>(i), mass);
    const std::size_t k = 6 + hinges_ + i;
    mass.at(k, k) += wheel.servo.rotor_inertia_kg_m2;
  }
}

// Computes M⁻¹ and (M + h D + h² K)⁻¹, where h is the step and the diagonal matrices D and K hold the damping and
// stiffness of hinges and wheels: the second one makes a step of implicit Euler.
void CarDynamics::update_inverses() {
  inverse_ = implicit_inverse_ = mass_;
  inverse_.invert();
  for (std::size_t i = 0; i < hinges_; ++i) {
    const HingeSpec& hinge = body_.hinges[i];
    implicit_inverse_.at(6 + i, 6 + i) += step_s_ * (hinge.damping_n_m_s_rad + step_s_ * hinge.stiffness_n_m_rad);
  }
  for (std::size_t i = 0; i < wheels_; ++i) {
    const std::size_t k = 6 + hinges_ + i;
    implicit_inverse_.at(k, k) += step_s_ * damping_[i];
  }
  implicit_inverse_.invert();
}

// Adds one step's acceleration by gravity, flexures and wheel torques to the velocity, by implicit Euler: the matrix
// of respond() holds damping and stiffness, so that the forces here are those for the velocity at the start of the
// step.
void CarDynamics::accelerate(const std::vector<double>& torque_n_m, const std::vector<double>& wheel_damping) {
  if (wheel_damping != damping_) {
    damping_ = wheel_damping;
    update_inverses();
  }
  // Gravity accelerates the car's translation: its generalised force is the columns of M of translation times gravity.
  const Vec3 gravity = turn.to_body({0, 0, -kGravity_m_s2});
  for (std::size_t i = 0; i < size_; ++i) {
    force_[i] = mass_.at(i, 0) * gravity.x + mass_.at(i, 1) * gravity.y + mass_.at(i, 2) * gravity.z;
  }
  for (std::size_t i = 0; i < hinges_; ++i) {
    const HingeSpec& hinge = body_.hinges[i];
    const double rate = velocity[6 + i];
    force_[6 + i] -= hinge.stiffness_n_m_rad * (hinge_rad[i] + step_s_ * rate) + hinge.damping_n_m_s_rad * rate;
  }
  for (std::size_t i = 0; i < wheels_; ++i) force_[6 + hinges_ + i] += torque_n_m[i];
  implicit_inverse_.multiply(force_.data(), acceleration_.data());
  for (std::size_t i = 0; i < size_; ++i) velocity[i] += step_s_ * acceleration_[i];
}

// Moves the car by one step of the velocities u (first segment's velocity and angular velocity in its own axes,
// hinges' rates, wheels' rates), then computes `velocity` in the moved axes from the momentum M · velocity:
// 1. Shift and turn of the first segment leave linear and angular momentum as they are in the world: both are turned
//    into the new axes, and the angular one is taken about the new origin.
// 2. A hinge's momentum changes by ∂(kinetic energy)/∂(its angle) per second (Lagrange), here by finite differences.
// 3. The hinges take their new angles, and the velocity is M⁻¹ of these with the new momentum.
void CarDynamics::move(const std::vector<double>& u) {
  mass_.multiply(velocity.data(), momentum_.data());
  const Vec3 shift = step_s_ * Vec3{u[0], u[1], u[2]};
  const Rotation rotation = rotation_by(step_s_ * Vec3{u[3], u[4], u[5]});
  position_m = position_m + turn.to_world(shift);
  turn = turn * rotation;
  for (std::size_t i = 0; i < wheels_; ++i) wheel_rad[i] += step_s_ * u[6 + hinges_ + i];
  const Vec3 linear{momentum_[0], momentum_[1], momentum_[2]}, angular{momentum_[3], momentum_[4], momentum_[5]};
  const Vec3 p = rotation.to_body(linear), l = rotation.to_body(angular - cross(shift, linear));
  const double moved_momentum[6] = {p.x, p.y, p.z, l.x, l.y, l.z};
  for (std::size_t i = 0; i < 6; ++i) momentum_[i] = moved_momentum[i];
  // Step 2. energy(angle): kinetic energy at the old velocity if this hinge had that angle.
  for (std::size_t i = 0; i < hinges_; ++i) {
    const double at_rad = hinge_rad[i];
    const auto energy = [&](double angle_rad) {
      hinge_rad[i] = angle_rad;
      place_segments();
      fill_mass(mass_);
      mass_.multiply(velocity.data(), force_.data());
      double sum = 0;
      for (std::size_t j = 0; j < size_; ++j) sum += 0.5 * velocity[j] * force_[j];
      return sum;
    };
    // The order of these two evaluations affects the last bits. It is fixed, so that results do not depend on the
    // compiler.
    const double below_j = energy(at_rad - kDifference_rad), above_j = energy(at_rad + kDifference_rad);
    hinge_rad[i] = at_rad;
    momentum_[6 + i] += step_s_ * (above_j - below_j) / (2 * kDifference_rad);
  }
  if (hinges_ > 0) {
    for (std::size_t i = 0; i < hinges_; ++i) hinge_rad[i] += step_s_ * u[6 + i];
    place_segments();
    fill_mass(mass_);
    update_inverses();
  }
  inverse_.multiply(momentum_.data(), acceleration_.data());
  velocity.assign(acceleration_.begin(), acceleration_.begin() + static_cast<std::ptrdiff_t>(size_));
}

// Kinetic energy ½ uᵀ M u, potential energy of segments and wheels above z = 0, and the flexures' elastic energy.
double CarDynamics::mechanical_energy_j() const {
  double energy_j = 0;
  for (std::size_t i = 0; i < size_; ++i) {
    for (std::size_t j = 0; j < size_; ++j) energy_j += 0.5 * velocity[i] * mass_.at(i, j) * velocity[j];
  }
  const auto height_m = [&](const Vec3& at_m) { return position_m.z + turn.to_world(at_m).z; };
  for (std::size_t j = 0; j < frames_.size(); ++j) {
    const SegmentSpec& part = body_.segments[j];
    energy_j += part.mass_kg * kGravity_m_s2 * height_m(place(j, {part.com_x_m, part.com_y_m, part.com_z_m}));
  }
  for (std::size_t i = 0; i < wheels_; ++i) {
    energy_j += body_.wheels[i].mass_kg * kGravity_m_s2 * height_m(axle_[i]);
  }
  for (std::size_t i = 0; i < hinges_; ++i) {
    energy_j += 0.5 * body_.hinges[i].stiffness_n_m_rad * hinge_rad[i] * hinge_rad[i];
  }
  return energy_j;
}

}  // namespace foldcar
