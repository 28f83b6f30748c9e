#include "contact_solver.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "elementary_functions.h"
#include "row_vector.h"

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

// Solver of a car whose rows have kSize numbers, the last ones zeros if its velocities are fewer.
template <std::size_t kSize>
class FixedSizeSolver : public ContactSolver {
 public:
  FixedSizeSolver(const BodySpec& body, double step_s, int iterations)
      : body_(body),
        step_s_(step_s),
        iterations_(iterations),
        impact_steps_(static_cast<int>(std::lround(kImpactTime_s / step_s))),
        impact_share_(exponential(-step_s / kImpactTime_s)),
        limit_impulse_(2 * body.hinges.size()) {}

  const std::vector<double>& solve(CarDynamics& car, std::vector<Contact>& contacts) override;

 private:
  using Velocity = RowVector<kSize>;
  // A row of the Jacobian; a contact has three in sequence: normal, along, across. biased_m_s and unbiased_m_s: the
  // velocity b that the row is solved for (contact_solver.h), with and without the closing of penetrations.
  // Aligned, so that no pair of numbers lies in two cache lines.
  struct Row {
    alignas(16) double jacobian[kSize] = {};
    alignas(16) double response[kSize] = {};
    double inverse_mass = 0, mass = 0, impulse = 0, biased_m_s = 0, unbiased_m_s = 0;
  };
  void set_contact(const CarDynamics& car, const Velocity& velocity, Contact& contact, Row* rows) const;
  void set_limits(const CarDynamics& car, std::size_t hinge, Row* rows) const;
  void complete(const CarDynamics& car, std::size_t segment, int wheel, double impulse, Row& row) const;
  void set_gap(double gap_m, Row& row) const;
  void set_impact(const Velocity& velocity, Contact& contact, Row& normal) const;
  void settle(const std::vector<Contact>& contacts, bool use_bias, Velocity& velocity);
  double iterate(const std::vector<Contact>& contacts, bool backward, bool use_bias, Velocity& velocity);

  const BodySpec& body_;
  const double step_s_;
  const int iterations_;
  const int impact_steps_;
  const double impact_share_;
  std::vector<Row> rows_;
  std::vector<double> biased_velocity_;
  std::vector<double> limit_impulse_;  // of the hinges in the last step
};

// Completes the row whose Jacobian is set: its response M⁻¹ Jᵀ, effective mass and first guess of the impulse.
template <std::size_t kSize>
void FixedSizeSolver<kSize>::complete(const CarDynamics& car, std::size_t segment, int wheel, double impulse,
                                      Row& row) const {
  const Velocity response = car.response(row.jacobian, segment, wheel);
  response.store(row.response);
  row.inverse_mass = response.dot(row.jacobian);
  row.mass = 1 / row.inverse_mass;
  row.impulse = impulse;
}

// Sets the velocities to solve for. A gap may close within the step, not more; a penetration (gap_m <= 0) may not grow,
// and in the solution with bias is closed in part.
template <std::size_t kSize>
void FixedSizeSolver<kSize>::set_gap(double gap_m, Row& row) const {
  const double closing_m_s = std::min(-kClosedShare * gap_m / step_s_, kClosingSpeed_m_s);
  row.biased_m_s = gap_m > 0 ? -gap_m / step_s_ : closing_m_s;
  row.unbiased_m_s = gap_m > 0 ? -gap_m / step_s_ : 0;
}

// Begins, continues or ends an impact of the contact, and sets its normal row's velocities: for kImpactTime_s a slower
// approach in each step, then one step with the rebound's velocity.
template <std::size_t kSize>
void FixedSizeSolver<kSize>::set_impact(const Velocity& velocity, Contact& contact, Row& normal) const {
  const double approach_m_s = -velocity.dot(normal.jacobian);
  const bool arrives = contact.gap_m <= approach_m_s * step_s_;
  if (!arrives || (contact.impact_steps == 0 && approach_m_s < kImpactSpeed_m_s)) {
    contact.impact_steps = 0;
    contact.approach_m_s = 0;
    return;
  }
  contact.approach_m_s = std::max(contact.approach_m_s, approach_m_s);
  if (++contact.impact_steps <= impact_steps_) {
    normal.unbiased_m_s = -impact_share_ * approach_m_s;
    normal.biased_m_s = std::min(normal.biased_m_s, normal.unbiased_m_s);
  } else {
    normal.unbiased_m_s = kRestitution * (contact.approach_m_s - kImpactSpeed_m_s);
    normal.biased_m_s = std::max(normal.biased_m_s, normal.unbiased_m_s);
    contact.impact_steps = 0;
    contact.approach_m_s = 0;
  }
}

// Sets a contact's three rows: normal, along, across.
template <std::size_t kSize>
void FixedSizeSolver<kSize>::set_contact(const CarDynamics& car, const Velocity& velocity, Contact& contact,
                                         Row* rows) const {
  const Vec3 point_m = car.turn.to_body(contact.point_m - car.position_m);
  const auto set_row = [&](int k, const Vec3& direction) {
    car.jacobian(point_m, car.turn.to_body(direction), contact.segment, contact.wheel, rows[k].jacobian);
    complete(car, contact.segment, contact.wheel, contact.impulse_n_s[k], rows[k]);
    rows[k].biased_m_s = rows[k].unbiased_m_s = 0;
  };
  set_row(0, contact.normal);
  set_row(1, contact.along);
  set_row(2, cross(contact.normal, contact.along));
  set_gap(contact.gap_m, rows[0]);
  set_impact(velocity, contact, rows[0]);
}

// Sets the rows of a hinge's lower and upper limit.
template <std::size_t kSize>
void FixedSizeSolver<kSize>::set_limits(const CarDynamics& car, std::size_t hinge, Row* rows) const {
  const HingeSpec& spec = body_.hinges[hinge];
  const double gaps_rad[2] = {car.hinge_rad[hinge] - spec.min_rad, spec.max_rad - car.hinge_rad[hinge]};
  for (std::size_t side = 0; side < 2; ++side) {
    std::fill_n(rows[side].jacobian, kSize, 0.0);
    rows[side].jacobian[6 + hinge] = side == 0 ? 1 : -1;
    complete(car, hinge + 1, kNoWheel, limit_impulse_[2 * hinge + side], rows[side]);
    set_gap(gaps_rad[side], rows[side]);
  }
}

// Solves one step. Rows: those of every contact, then both limits of every hinge. Starts from the last step's
// impulses; solves first with bias, which gives the returned velocities (they also close penetrations), then without,
// which gives car.velocity and the impulses.
template <std::size_t kSize>
const std::vector<double>& FixedSizeSolver<kSize>::solve(CarDynamics& car, std::vector<Contact>& contacts) {
  const std::size_t limits_at = 3 * contacts.size();
  rows_.resize(limits_at + limit_impulse_.size());
  Velocity velocity(car.velocity);
  for (std::size_t c = 0; c < contacts.size(); ++c) set_contact(car, velocity, contacts[c], &rows_[3 * c]);
  for (std::size_t i = 0; i < body_.hinges.size(); ++i) set_limits(car, i, &rows_[limits_at + 2 * i]);
  for (const Row& row : rows_) velocity.add(row.impulse, row.response);
  settle(contacts, true, velocity);
  biased_velocity_.resize(car.size());
  velocity.store(biased_velocity_);
  settle(contacts, false, velocity);
  velocity.store(car.velocity);
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    for (std::size_t k = 0; k < 3; ++k) contacts[c].impulse_n_s[k] = rows_[3 * c + k].impulse;
  }
  for (std::size_t i = 0; i < limit_impulse_.size(); ++i) limit_impulse_[i] = rows_[limits_at + i].impulse;
  return biased_velocity_;
}

// Passes over all rows, there and back in turn, until a pass changes no row's velocity by more than the tolerance.
template <std::size_t kSize>
void FixedSizeSolver<kSize>::settle(const std::vector<Contact>& contacts, bool use_bias, Velocity& velocity) {
  // A copy that nothing points to stays in registers.
  Velocity settling = velocity;
  for (int i = 0; i < iterations_ && iterate(contacts, i % 2 == 1, use_bias, settling) > kTolerance_m_s; ++i) {
  }
  velocity = settling;
}

// One Gauss-Seidel pass: solves each row in turn for its velocity, then projects its impulse onto what is allowed, ≥ 0
// for normals and limits, the cone |(a, b)| ≤ friction · normal impulse for a contact's two tangents. Returns the
// largest change of a row's velocity (m/s) by its own impulse. kYield and kCompliance: the condition of a yielding
// contact.
template <std::size_t kSize>
double FixedSizeSolver<kSize>::iterate(const std::vector<Contact>& contacts, bool backward, bool use_bias,
                                       Velocity& velocity) {
  double largest_m_s = 0;
  // The change of a row's impulse (N·s) that brings its velocity to wanted_m_s, with all other impulses held.
  const auto impulse_change = [&](const Row& row, double wanted_m_s) {
    return ((wanted_m_s - velocity.dot(row.jacobian)) * row.mass - kCompliance * row.impulse) * kYield;
  };
  const auto set_impulse = [&](Row& row, double impulse) {
    const double change = impulse - row.impulse;
    largest_m_s = std::max(largest_m_s, std::abs(change) * row.inverse_mass);
    velocity.add(change, row.response);
    row.impulse = impulse;
  };
  const auto solve_normal = [&](Row& row) {
    const double solved = row.impulse + impulse_change(row, use_bias ? row.biased_m_s : row.unbiased_m_s);
    const double impulse = std::max(0.0, solved);
    // Most rows without load stay without: the next row need not wait for this one.
    if (impulse != row.impulse) set_impulse(row, impulse);
  };
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    const std::size_t contact = backward ? contacts.size() - 1 - c : c;
    Row &normal = rows_[3 * contact], &along = rows_[3 * contact + 1], &across = rows_[3 * contact + 2];
    solve_normal(normal);
    // Without load there is no friction.
    if (normal.impulse == 0 && along.impulse == 0 && across.impulse == 0) continue;
    // Changes of impulse that would stop the slip along and across.
    const double stop_a = impulse_change(along, 0), stop_b = impulse_change(across, 0);
    double a = along.impulse + stop_a, b = across.impulse + stop_b;
    const double limit = contacts[contact].friction * normal.impulse;
    if (a * a + b * b > limit * limit) {
      // It slides. Both slips are weighed by one mass, so that the impulse ends up opposite to the slip as a vector.
      const double least = std::min(along.mass, across.mass);
      a = along.impulse + stop_a * along.inverse_mass * least;
      b = across.impulse + stop_b * across.inverse_mass * least;
      const double size = std::sqrt(a * a + b * b), scale = size > limit ? limit / size : 1;
      a *= scale;
      b *= scale;
    }
    set_impulse(along, a);
    set_impulse(across, b);
  }
  for (std::size_t index = 3 * contacts.size(); index < rows_.size(); ++index) solve_normal(rows_[index]);
  return largest_m_s;
}

}  // namespace

std::unique_ptr<ContactSolver> make_contact_solver(const BodySpec& body, double step_s, int iterations) {
  switch (row_length(6 + body.hinges.size() + body.wheels.size())) {
    case 10: return std::make_unique<FixedSizeSolver<10>>(body, step_s, iterations);
    case 14: return std::make_unique<FixedSizeSolver<14>>(body, step_s, iterations);
    case 18: return std::make_unique<FixedSizeSolver<18>>(body, step_s, iterations);
    case 22: return std::make_unique<FixedSizeSolver<22>>(body, step_s, iterations);
    default: throw std::invalid_argument("multibody: the body has too many segments and wheels");
  }
}

}  // namespace foldcar
