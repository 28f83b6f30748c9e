#include "program_run.h"

#include <algorithm>
#include <cmath>

#include "elementary_functions.h"
#include "trial.h"

namespace foldcar {
namespace {

constexpr double kRounding_s = 1e-9;
constexpr double kTurn_rad = 6.283185307179586;

// The car's origin, its rise since the start, its attitude, energy and time since the start.
struct Moment {
  const CarState& car;
  double rise_m, energy_j, time_s;
};

// Distance from the place (x_m, y_m, z_m) to a point of the car, given ahead, left and above of its origin in its
// axes.
double distance_m(const Moment& now, double ahead_m, double left_m, double up_m, double x_m, double y_m, double z_m) {
  const SineCosine heading = sine_and_cosine(now.car.heading_rad), pitch = sine_and_cosine(now.car.pitch_rad),
                   roll = sine_and_cosine(now.car.roll_rad);
  // Intrinsic rotations: by the heading about z, then nose up, then left side up.
  const double out_m = ahead_m * pitch.cosine - (left_m * roll.sine + up_m * roll.cosine) * pitch.sine;
  const double side_m = left_m * roll.cosine - up_m * roll.sine;
  const double dx = now.car.x_m + out_m * heading.cosine - side_m * heading.sine - x_m;
  const double dy = now.car.y_m + out_m * heading.sine + side_m * heading.cosine - y_m;
  const double dz = now.rise_m + ahead_m * pitch.sine + (left_m * roll.sine + up_m * roll.cosine) * pitch.cosine - z_m;
  return std::sqrt(dx * dx + dy * dy + dz * dz);
}

// Returns whether a point is on an edge, which Scenic counts as inside, or inside: then a ray from it towards +x crosses an
// odd number of edges.
bool in_polygon(const std::vector<double>& corners_m, double x_m, double y_m) {
  bool inside = false;
  const std::size_t count = corners_m.size() / 2;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t j = (i + 1) % count;
    const double xi = corners_m[2 * i], yi = corners_m[2 * i + 1], xj = corners_m[2 * j], yj = corners_m[2 * j + 1];
    const bool is_beside = x_m >= std::min(xi, xj) && x_m <= std::max(xi, xj) && y_m >= std::min(yi, yj) &&
                           y_m <= std::max(yi, yj);
    if (is_beside && (xj - xi) * (y_m - yi) == (yj - yi) * (x_m - xi)) return true;
    if ((yi > y_m) != (yj > y_m) && x_m < xi + (y_m - yi) * (xj - xi) / (yj - yi)) inside = !inside;
  }
  return inside;
}

double quotient(double a, double b) {
  if (b == 0) throw TrialError("the program divides by zero");
  return a / b;
}

// Evaluates an expression in postfix order: every term takes its operands from the stack and puts its value on it.
// Returns the stack at the end: one number or truth (0 or 1), or a vector of three.
RecordedValue evaluated(const Expression& expression, const Moment& now) {
  using Kind = Term::Kind;
  std::vector<double> stack;
  const auto pop = [&] {
    const double top = stack.back();
    stack.pop_back();
    return top;
  };
  for (const Term& term : expression.terms) {
    double b = 0, value = 0;
    if (term.kind >= Kind::kAdd && term.kind <= Kind::kOr) b = pop();
    if (term.kind >= Kind::kNegate && term.kind <= Kind::kOr) value = pop();
    switch (term.kind) {
      case Kind::kNumber: value = term.number; break;
      case Kind::kX: value = now.car.x_m; break;
      case Kind::kY: value = now.car.y_m; break;
      case Kind::kRise: value = now.rise_m; break;
      case Kind::kHeading: value = now.car.heading_rad; break;
      case Kind::kPitch: value = now.car.pitch_rad; break;
      case Kind::kRoll: value = now.car.roll_rad; break;
      case Kind::kSpeed: value = now.car.speed_m_s; break;
      case Kind::kYawRate: value = now.car.yaw_rate_rad_s; break;
      case Kind::kEnergy: value = now.energy_j; break;
      case Kind::kTime: value = now.time_s; break;
      case Kind::kNegate: value = -value; break;
      case Kind::kAbs: value = std::abs(value); break;
      case Kind::kWrap: value = std::remainder(value, kTurn_rad); break;
      case Kind::kNot: value = value == 0; break;
      case Kind::kAdd: value += b; break;
      case Kind::kSubtract: value -= b; break;
      case Kind::kMultiply: value *= b; break;
      case Kind::kDivide: value = quotient(value, b); break;
      case Kind::kMin: value = std::min(value, b); break;
      case Kind::kMax: value = std::max(value, b); break;
      case Kind::kLess: value = value < b; break;
      case Kind::kLessEqual: value = value <= b; break;
      case Kind::kGreater: value = value > b; break;
      case Kind::kGreaterEqual: value = value >= b; break;
      case Kind::kAnd: value = value != 0 && b != 0; break;
      case Kind::kOr: value = value != 0 || b != 0; break;
      case Kind::kDistance: {
        const double z = pop(), y = pop(), x = pop();
        value = distance_m(now, 0, 0, 0, x, y, z);
        break;
      }
      case Kind::kDistanceFrom: {
        const double z = pop(), y = pop(), x = pop(), up = pop(), left = pop(), ahead = pop();
        value = distance_m(now, ahead, left, up, x, y, z);
        break;
      }
      case Kind::kInDisc: {
        const double radius = pop(), y = pop(), x = pop();
        value = hypotenuse(now.car.x_m - x, now.car.y_m - y) <= radius;
        break;
      }
      case Kind::kInPolygon: value = in_polygon(term.polygon_m, now.car.x_m, now.car.y_m); break;
    }
    if (!std::isfinite(value)) throw TrialError("a value of the program left the finite numbers");
    stack.push_back(value);
  }
  return stack;
}

}  // namespace

ProgramRun::ProgramRun(const ProgramSpec& program, const CarState& start)
    : program_(program), start_z_m_(start.z_m), start_energy_j_(start.consumed_energy_j) {
  for (const RecordSpec& record : program.records) recorded_.push_back({&record, {}, {}});
}

RecordedValue ProgramRun::value_of(const Expression& expression, const CarState& state, double elapsed_s) const {
  return evaluated(expression, {state, state.z_m - start_z_m_, state.consumed_energy_j - start_energy_j_, elapsed_s});
}

bool ProgramRun::holds(const Expression& expression, const CarState& state, double elapsed_s) const {
  return value_of(expression, state, elapsed_s).front() != 0;
}

// Returns the program's outcome, if one of its endings holds or its time limit is over. Passed: by the program's
// verdict, if it has one, else by the ending that holds.
std::optional<Outcome> ProgramRun::check(const CarState& state, double elapsed_s) const {
  const auto ended = std::find_if(program_.endings.begin(), program_.endings.end(), [&](const EndingSpec& ending) {
    return holds(ending.when, state, elapsed_s);
  });
  const bool limited = program_.time_limit_s && elapsed_s > 0 && elapsed_s >= *program_.time_limit_s - kRounding_s;
  if (ended == program_.endings.end() && !limited) return std::nullopt;
  const bool passed = program_.verdict ? holds(*program_.verdict, state, elapsed_s)
                                       : ended != program_.endings.end() && ended->passed;
  return passed ? Outcome::kPassed : Outcome::kTerminated;
}

// Records what is due now: series every step_s and at the end, initial values at the first call, final ones at the
// end.
void ProgramRun::record(const CarState& state, double elapsed_s, bool ends) {
  const bool first = looks_ == 0;
  const bool look = elapsed_s >= looks_ * program_.step_s - kRounding_s;
  if (look) ++looks_;
  for (Recorded& recorded : recorded_) {
    const RecordSpec& record = *recorded.record;
    const bool series = record.kind == RecordSpec::Kind::kSeries;
    const bool due = series ? look || ends : record.kind == RecordSpec::Kind::kInitial ? first : ends;
    if (!due) continue;
    if (series) recorded.times_s.push_back(elapsed_s);
    recorded.values.push_back(value_of(record.value, state, elapsed_s));
  }
}

}  // namespace foldcar
