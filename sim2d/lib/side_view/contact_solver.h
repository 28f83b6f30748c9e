// Contact impulses of one step: normal and both friction impulses of all contacts, solved together.
//
// The generalised velocities after the step are u + Σ Yᵀ λ with the rows J of the contacts' Jacobian and Y = M^-1 Jᵀ.
// Normal impulses satisfy the complementarity λ ≥ 0, v ≥ -gap/step; friction lies in the cone |λ_t| ≤ μ λ_n and opposes
// slip. Projected Gauss-Seidel iterations from the impulses of the last step, until they change little.
#pragma once

#include <cstddef>
#include <vector>

#include "car_dynamics.h"
#include "vec3.h"

namespace foldcar {

// A point where the car touches the ground, or is about to.
struct Contact {
  std::size_t segment = 0;
  int wheel = -1;  // index; negative for a belly
  Vec3 point_m;    // in the world
  Vec3 normal;     // unit vector into the car
  Vec3 along;      // unit vector in the tangent plane, along the heading
  double gap_m = 0;
  double across_m = 0;  // lateral coordinate on the tyre or belly, which tells contacts of one wheel apart
  double friction = 0;
  double impulse_n_s[3] = {0, 0, 0};  // result: normal, along, across; on entry a guess
  int impact_steps = 0;               // result: steps since an impact began, if it goes on; on entry the last step's
  double approach_m_s = 0;            // the same of its fastest approach
};

// Solves a hinge's limits as well, as rows without friction.
class ContactSolver {
 public:
  // iterations is the largest number of them.
  ContactSolver(const BodySpec& body, double step_s, int iterations);

  // Changes car.velocity and the contacts' impulses. Returns the velocities to move with, which also close penetrations
  // without giving their energy to the car.
  const std::vector<double>& solve(CarDynamics& car, std::vector<Contact>& contacts);

 private:
  // A row with its response; rows of a contact are three in sequence: normal, along, across.
  struct Row {
    double inverse_mass, mass, impulse, target_m_s, relaxed_m_s;
  };
  void add_row(const CarDynamics& car, double impulse, double gap_m);
  // Targets of the contact's normal row, the last one, during an impact.
  void strike(Contact& contact);
  double change(const Row& row, std::size_t index, double target_m_s) const;
  void apply(std::size_t index, double impulse);
  // One pass over all rows; the largest change of a row's velocity (m/s) by its own impulse.
  double iterate(const std::vector<Contact>& contacts, bool backward, bool relaxed);

  const BodySpec& body_;
  const double step_s_;
  const int iterations_;
  const int impact_steps_;
  const double impact_share_;
  std::size_t padded_ = 0;  // of a row
  std::vector<Row> rows_;
  std::vector<double> jacobian_, response_, velocity_, moving_;
  std::vector<double> limit_impulse_;  // of the hinges in the last step
};

}  // namespace foldcar
