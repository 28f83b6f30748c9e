// The car's equations of motion: rigid segments in a chain of pitch hinges, with wheels that spin about their axles.
//
// Generalised velocities u: velocity v (m/s) of the car's origin in the first segment and angular velocity ω (rad/s),
// both in that segment's axes; the hinges' rates; the wheels' rates relative to their segments, positive forwards.
// The kinetic energy is ½ uᵀ M u. M depends on the hinges' angles only: without hinges it is constant.
// Input: forces and impulses. Output: pose, velocities, Jacobians of points. SI units; axes forward, left, up.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "body_spec.h"
#include "square_matrix.h"
#include "vec3.h"

namespace foldcar {

// In place of a wheel's number: a point or part that turns with its segment.
constexpr int kNoWheel = -1;

class CarDynamics {
 public:
  // At the world's origin, at rest; body must outlive it.
  CarDynamics(const BodySpec& body, double step_s);

  std::size_t size() const { return size_; }

  // Pose of the first segment; the hinges' angles, positive as HingeSpec says, and the wheels' (rad).
  Vec3 position_m;
  Rotation turn;
  std::vector<double> hinge_rad, wheel_rad;
  std::vector<double> velocity;  // u

  // Converts a point of a segment from the drawing's coordinates (all hinges straight) to the first segment's axes,
  // with the hinges at their present angles.
  Vec3 place(std::size_t segment, const Vec3& point_m) const;
  Vec3 axle(std::size_t wheel) const { return axle_[wheel]; }
  // A segment's pitch against the first one: a turn about the left axis.
  double fold_rad(std::size_t segment) const { return frames_[segment].angle_rad; }

  // Adds to `velocity` what gravity, the flexures' springs and the wheel torques (N·m) give in one step. wheel_damping
  // (N·m·s) is what each torque falls by per rad/s of its wheel. Implicit Euler: this fall and the flexures' force are
  // those at the end of the step, so that stiff ones do not oscillate.
  void accelerate(const std::vector<double>& torque_n_m, const std::vector<double>& wheel_damping);
  // Fills a row of the Jacobian, with zeros behind its size() numbers: row · u is the velocity along a direction of a
  // point that moves with a segment or, if wheel >= 0, with that wheel. Point and direction are in the first segment's
  // axes.
  template <std::size_t kSize>
  void jacobian(const Vec3& point_m, const Vec3& direction, std::size_t segment, int wheel,
                double (&row)[kSize]) const;
  // (M + implicit terms)^-1 row: the change of u by a unit impulse along a row of that segment or wheel (terms:
  // update_inverses). kSize: row_length(size()).
  template <std::size_t kSize>
  RowVector<kSize> response(const double (&row)[kSize], std::size_t segment, int wheel) const;
  // Moves the car by one step of the velocities u. Then expresses `velocity` in the new pose's axes, such that linear
  // and angular momentum are conserved.
  void move(const std::vector<double>& u);

  double mechanical_energy_j() const;

 private:
  // A segment's axes in those of the first: turned about the left axis, its drawing's origin at x, z.
  struct Frame {
    double angle_rad = 0, cosine = 1, sine = 0, x_m = 0, z_m = 0;
  };
  void place_segments();
  void fill_mass(SquareMatrix& mass) const;
  void add_part(double mass_kg, const Vec3& at_m, const Vec3& inertia_kg_m2, std::size_t segment, int wheel,
                SquareMatrix& mass) const;
  void update_inverses();

  const BodySpec& body_;
  const double step_s_;
  const std::size_t hinges_, wheels_, size_;
  std::vector<Frame> frames_;
  std::vector<Vec3> hinge_at_, axle_;
  SquareMatrix mass_, inverse_, implicit_inverse_;
  std::vector<double> damping_;  // of the wheels, as in implicit_inverse_
  std::vector<double> force_, acceleration_, momentum_;
};

// Fills `row` so that row · u is the point's velocity along `direction`. Order of u: the first segment's velocity (3)
// and angular velocity (3), the hinges' rates, the wheels' rates. Hinges and axles turn about the left axis, so that a
// rate of 1 rad/s about `axis` moves the point at left × (point - axis); a hinge moves the segments behind it in the
// chain.
template <std::size_t kSize>
void CarDynamics::jacobian(const Vec3& point_m, const Vec3& direction, std::size_t segment, int wheel,
                           double (&row)[kSize]) const {
  const Vec3 moment = cross(point_m, direction);
  row[0] = direction.x;
  row[1] = direction.y;
  row[2] = direction.z;
  row[3] = moment.x;
  row[4] = moment.y;
  row[5] = moment.z;
  std::fill(row + 6, row + kSize, 0.0);
  const auto about = [&](const Vec3& axis) {
    return (point_m.z - axis.z) * direction.x - (point_m.x - axis.x) * direction.z;
  };
  for (std::size_t i = 0; i < segment; ++i) row[6 + i] = about(hinge_at_[i]);
  if (wheel >= 0) row[6 + hinges_ + static_cast<std::size_t>(wheel)] = about(axle_[static_cast<std::size_t>(wheel)]);
}

// A sum of columns, without those for which the row has zeros: of the hinges behind the segment and of other wheels.
template <std::size_t kSize>
RowVector<kSize> CarDynamics::response(const double (&row)[kSize], std::size_t segment, int wheel) const {
  RowVector<kSize> sums;
  for (std::size_t j = 0; j < 6 + segment; ++j) sums.add(row[j], implicit_inverse_.column(j));
  if (wheel >= 0) {
    const std::size_t j = 6 + hinges_ + static_cast<std::size_t>(wheel);
    sums.add(row[j], implicit_inverse_.column(j));
  }
  return sums;
}

}  // namespace foldcar
