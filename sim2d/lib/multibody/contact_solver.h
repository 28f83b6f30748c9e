// Contact impulses of one step: normal and both friction impulses of all contacts, solved together.
//
// The car has generalised velocities u and mass matrix M (car_dynamics.h). A row J of the contact Jacobian gives a
// point's velocity along one direction, v = J u: every contact has three rows, its normal and two tangents, every
// hinge two, its limits. An impulse λ along a row changes u by M⁻¹ Jᵀ λ, and so v of its own row by λ / m with
//
//   m = 1 / (J M⁻¹ Jᵀ)                  the row's effective mass (`mass`; its inverse `inverse_mass`),
//   Y = M⁻¹ Jᵀ                          the row's response (`response`),
//   u = u* + Σ Y λ                      over all rows, from the free motion's u* (`velocity`).
//
// Normal. A contact with gap g (negative: a penetration) may close at most g in a step h, so that v ≥ -g/h, and only
// pushes:
//
//   λ ≥ 0,   v - b ≥ 0,   λ (v - b) = 0        complementarity,
//   b = -g/h                                   g > 0: it may just arrive,
//   b = min(-β g/h, b_max)                     g ≤ 0: a share β of the penetration is closed, at most at b_max.
//
// Compliance. A car on more wheels than statics can tell the loads of is indeterminate. Let each contact yield by γ λ,
// as a soft contact does: the condition on v becomes
//
//   v + γ λ - b = 0   where λ > 0,             γ = c / m, c a small number (kCompliance).
//
// For one row, with all others held, v grows by Δλ / m. To satisfy the condition Δλ must be
//
//   (v + Δλ/m) + (c/m) (λ + Δλ) = b
//   Δλ = [ (b - v) m - c λ ] / (1 + c)         `impulse_change`; 1 / (1 + c): kYield,
//
// and λ ← max(0, λ + Δλ). This is Box2D's soft step: its massScale is 1 / (1 + c) and its impulseScale c / (1 + c).
// There they follow from a damped spring, here from c, and the spring's push is the bias b.
//
// Friction. Of both tangents' impulses λ_t, Coulomb's cone |λ_t| ≤ μ λ asks for v_t = 0 within it and an impulse
// against the slip on its surface. The step for b = 0 is projected back onto the cone; there both slips are weighed by
// one mass, as else λ_t would not end up opposite to the slip.
//
// Bias and energy. b would leave the car with the speed at which penetrations are closed. As Box2D does, rows are
// solved twice: with the bias, which gives the velocities to move the positions with (`biased_velocity_`), then
// without it, from those impulses, which gives u. Without bias is b = min(-g/h, 0): `unbiased_m_s`.
//
// Impacts. An approach v⁻ < -v_impact begins an impact. It lasts τ; every step of it reduces the approach by the
// factor exp(-h/τ), b = exp(-h/τ) v⁻. In the step after it the contact rebounds, b = e (|v⁻|max - v_impact).
//
// Projected Gauss-Seidel: rows are solved one after another, there and back in turn, from the last step's impulses,
// until a pass changes no row's velocity by more than a tolerance.
#pragma once

#include <cstddef>
#include <memory>
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
  int impact_steps = 0;     // steps since an impact began, 0 outside impacts; on entry as the last step left it
  double approach_m_s = 0;  // fastest approach of this impact so far; on entry as the last step left it
};

// Computes the impulses of contacts and of hinges at their limits (rows without friction), by projected Gauss-Seidel.
class ContactSolver {
 public:
  virtual ~ContactSolver() = default;

  // Changes car.velocity and the contacts' impulses. Returns the velocities to move the car's pose with: they also
  // close penetrations, and as they are not kept, closing gives the car no energy.
  virtual const std::vector<double>& solve(CarDynamics& car, std::vector<Contact>& contacts) = 0;
};

// The solver for the body's number of velocities: the compiler knows the length of its rows. body must outlive it.
// iterations: the largest number of passes over all rows in each of the two solutions of a step.
std::unique_ptr<ContactSolver> make_contact_solver(const BodySpec& body, double step_s, int iterations);

}  // namespace foldcar
