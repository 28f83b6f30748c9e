#include "contact_solver.h"

#include <algorithm>
#include <cmath>

#include "elementary_functions.h"

namespace foldcar {
namespace {

// A step closes this share of a penetration, at most at this speed.
constexpr double kClosedShare = 0.2;
constexpr double kClosingSpeed_m_s = 0.5;
// Compliance of a contact per inverse mass of its row. It distributes the loads of a statically indeterminate car,
// friction too, as tyres of equal stiffness do; without it wheels can jam each other where they need not.
constexpr double kCompliance = 0.02;
constexpr double kYield = 1 / (1 + kCompliance);
// An impact faster than kImpactSpeed_m_s takes kImpactTime_s, as tyres, film and servo shafts give way: every step of
// it multiplies the approach by exp(-step / kImpactTime_s). Then the contact rebounds at
// kRestitution · (fastest approach - kImpactSpeed_m_s).
constexpr double kImpactSpeed_m_s = 0.2;
constexpr double kImpactTime_s = 0.008;
constexpr double kRestitution = 0.2;
// A solution ends with the pass in which no row's velocity changes by more than this.
constexpr double kTolerance_m_s = 5e-4;

// Dot product of vectors whose length is a multiple of four (`padded`, filled up with zeros): four sums side by side,
// which the compiler computes in vector registers.
double dot(const double* a, const double* b, std::size_t padded) {
  double sums[4] = {0, 0, 0, 0};
  for (std::size_t i = 0; i < padded; i += 4) {
    for (std::size_t k = 0; k < 4; ++k) sums[k] += a[i + k] * b[i + k];
  }
  return (sums[0] + sums[2]) + (sums[1] + sums[3]);
}

}  // namespace

ContactSolver::ContactSolver(const BodySpec& body, double step_s, int iterations)
    : body_(body),
      step_s_(step_s),
      iterations_(iterations),
      impact_steps_(static_cast<int>(std::lround(kImpactTime_s / step_s))),
      impact_share_(exponential(-step_s / kImpactTime_s)),
      limit_impulse_(2 * body.hinges.size()) {}

// Adds the row whose Jacobian the caller has written at the end of jacobian_: its response M⁻¹ Jᵀ, effective mass,
// first guess of the impulse, and the velocities to solve for. A gap may close within the step, not more; a
// penetration (gap_m <= 0) may not grow, and in the solution with bias is closed in part.
void ContactSolver::add_row(const CarDynamics& car, double impulse, double gap_m) {
  const std::size_t at = rows_.size() * padded_;
  response_.resize(at + padded_);
  car.respond(&jacobian_[at], &response_[at]);
  const double inverse_mass = dot(&jacobian_[at], &response_[at], padded_);
  const double closing_m_s = std::min(-kClosedShare * gap_m / step_s_, kClosingSpeed_m_s);
  rows_.push_back({inverse_mass, 1 / inverse_mass, impulse, gap_m > 0 ? -gap_m / step_s_ : closing_m_s,
                   gap_m > 0 ? -gap_m / step_s_ : 0});
}

// Begins, continues or ends an impact of the contact whose normal row was added last, and sets that row's velocities:
// for kImpactTime_s a slower approach in each step, then one step with the rebound's velocity.
void ContactSolver::set_impact(Contact& contact) {
  const double approach_m_s = -dot(&jacobian_[(rows_.size() - 1) * padded_], velocity_.data(), padded_);
  const bool arrives = contact.gap_m <= approach_m_s * step_s_;
  if (!arrives || (contact.impact_steps == 0 && approach_m_s < kImpactSpeed_m_s)) {
    contact.impact_steps = 0;
    contact.approach_m_s = 0;
    return;
  }
  contact.approach_m_s = std::max(contact.approach_m_s, approach_m_s);
  Row& row = rows_.back();
  if (++contact.impact_steps <= impact_steps_) {
    row.unbiased_m_s = -impact_share_ * approach_m_s;
    row.biased_m_s = std::min(row.biased_m_s, row.unbiased_m_s);
  } else {
    row.unbiased_m_s = kRestitution * (contact.approach_m_s - kImpactSpeed_m_s);
    row.biased_m_s = std::max(row.biased_m_s, row.unbiased_m_s);
    contact.impact_steps = 0;
    contact.approach_m_s = 0;
  }
}

// Solves one step. Rows: normal, along, across of every contact, then both limits of every hinge. Starts from the last
// step's impulses, and passes over all rows until the velocities settle: first with bias, which gives the returned
// velocities (they also close penetrations), then without, which gives car.velocity and the impulses.
const std::vector<double>& ContactSolver::solve(CarDynamics& car, std::vector<Contact>& contacts) {
  const std::size_t size = car.size();
  padded_ = (size + 3) / 4 * 4;
  rows_.clear();
  jacobian_.resize((3 * contacts.size() + limit_impulse_.size()) * padded_);
  velocity_ = car.velocity;
  velocity_.resize(padded_);
  for (Contact& contact : contacts) {
    const Vec3 point_m = car.turn.to_body(contact.point_m - car.position_m);
    const Vec3 across = cross(contact.normal, contact.along);
    const Vec3 directions[3] = {contact.normal, contact.along, across};
    for (int k = 0; k < 3; ++k) {
      car.jacobian(point_m, car.turn.to_body(directions[k]), contact.segment, contact.wheel,
                   &jacobian_[rows_.size() * padded_]);
      add_row(car, contact.impulse_n_s[k], k == 0 ? contact.gap_m : 0);
      if (k > 0) rows_.back().biased_m_s = rows_.back().unbiased_m_s = 0;
      if (k == 0) set_impact(contact);
    }
  }
  for (std::size_t i = 0; i < body_.hinges.size(); ++i) {
    const HingeSpec& hinge = body_.hinges[i];
    for (int side = 0; side < 2; ++side) {
      double* row = &jacobian_[rows_.size() * padded_];
      std::fill(row, row + padded_, 0.0);
      row[6 + i] = side == 0 ? 1 : -1;
      add_row(car, limit_impulse_[2 * i + static_cast<std::size_t>(side)],
              side == 0 ? car.hinge_rad[i] - hinge.min_rad : hinge.max_rad - car.hinge_rad[i]);
    }
  }
  for (std::size_t index = 0; index < rows_.size(); ++index) apply(index, rows_[index].impulse);
  for (int i = 0; i < iterations_ && iterate(contacts, i % 2 == 1, true) > kTolerance_m_s; ++i) {
  }
  biased_velocity_ = velocity_;
  for (int i = 0; i < iterations_ && iterate(contacts, i % 2 == 1, false) > kTolerance_m_s; ++i) {
  }
  std::copy_n(velocity_.begin(), size, car.velocity.begin());
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    for (std::size_t k = 0; k < 3; ++k) contacts[c].impulse_n_s[k] = rows_[3 * c + k].impulse;
  }
  for (std::size_t i = 0; i < limit_impulse_.size(); ++i) limit_impulse_[i] = rows_[3 * contacts.size() + i].impulse;
  return biased_velocity_;
}

// Returns the change of the row's impulse (N·s) that brings its velocity to wanted_m_s, with all other impulses held.
double ContactSolver::impulse_change(const Row& row, std::size_t index, double wanted_m_s) const {
  return (wanted_m_s - dot(&jacobian_[index * padded_], velocity_.data(), padded_)) * row.mass;
}

// Adds to velocity_ what an impulse (N·s) along row `index` gives.
void ContactSolver::apply(std::size_t index, double impulse) {
  const double* response = &response_[index * padded_];
  for (std::size_t i = 0; i < padded_; ++i) velocity_[i] += impulse * response[i];
}

// One Gauss-Seidel pass: solves each row in turn for its velocity, then projects its impulse onto what is allowed, ≥ 0
// for normals and limits, the cone |(a, b)| ≤ friction · normal impulse for a contact's two tangents. Returns the
// largest change of a row's velocity (m/s) by its own impulse. kYield and kCompliance: the condition of a yielding
// contact.
double ContactSolver::iterate(const std::vector<Contact>& contacts, bool backward, bool use_bias) {
  double largest_m_s = 0;
  const auto solve_normal = [&](std::size_t index) {
    Row& row = rows_[index];
    const double wanted_m_s = use_bias ? row.biased_m_s : row.unbiased_m_s;
    const double solved = row.impulse + (impulse_change(row, index, wanted_m_s) - kCompliance * row.impulse) * kYield;
    const double impulse = std::max(0.0, solved);
    largest_m_s = std::max(largest_m_s, std::abs(impulse - row.impulse) * row.inverse_mass);
    apply(index, impulse - row.impulse);
    row.impulse = impulse;
  };
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    const std::size_t first = 3 * (backward ? contacts.size() - 1 - c : c);
    solve_normal(first);
    Row &along = rows_[first + 1], &across = rows_[first + 2];
    // Without load there is no friction.
    if (rows_[first].impulse == 0 && along.impulse == 0 && across.impulse == 0) continue;
    // Changes of impulse that would stop the slip along and across.
    const double stop_a = (impulse_change(along, first + 1, 0) - kCompliance * along.impulse) * kYield;
    const double stop_b = (impulse_change(across, first + 2, 0) - kCompliance * across.impulse) * kYield;
    double a = along.impulse + stop_a, b = across.impulse + stop_b;
    const double limit = contacts[first / 3].friction * rows_[first].impulse;
    if (a * a + b * b > limit * limit) {
      // It slides. Both slips are weighed by one mass, so that the impulse ends up opposite to the slip as a vector.
      const double least = std::min(along.mass, across.mass);
      a = along.impulse + stop_a * along.inverse_mass * least;
      b = across.impulse + stop_b * across.inverse_mass * least;
      const double size = std::sqrt(a * a + b * b), scale = size > limit ? limit / size : 1;
      a *= scale;
      b *= scale;
    }
    largest_m_s = std::max(largest_m_s, std::abs(a - along.impulse) * along.inverse_mass);
    largest_m_s = std::max(largest_m_s, std::abs(b - across.impulse) * across.inverse_mass);
    apply(first + 1, a - along.impulse);
    apply(first + 2, b - across.impulse);
    along.impulse = a;
    across.impulse = b;
  }
  for (std::size_t index = 3 * contacts.size(); index < rows_.size(); ++index) solve_normal(index);
  return largest_m_s;
}

}  // namespace foldcar
