// A scene's program beside one trial: whether it ends the trial, and what it records.
//
// Input: the program, the car's state at each step. Output: an outcome, recorded values. Throws TrialError where a value
// is not a finite number.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "outcome.h"
#include "program_spec.h"
#include "sim_car.h"

namespace foldcar {

// A recorded value: one number or truth, or the three numbers of a vector.
using RecordedValue = std::vector<double>;

// What a run recorded under a name: one value, or those of a series with their times.
struct Recorded {
  const RecordSpec* record = nullptr;
  std::vector<double> times_s;  // of a series
  std::vector<RecordedValue> values;
};

class ProgramRun {
 public:
  // start: the state at the start of the trial. program must outlive it.
  ProgramRun(const ProgramSpec& program, const CarState& start);

  // The outcome if the program ends the trial at that state. To be called at every step.
  std::optional<Outcome> check(const CarState& state, double elapsed_s) const;
  // Takes initial values and those of series; ends: whether the trial ends at that state. To be called at every step.
  void record(const CarState& state, double elapsed_s, bool ends);
  const std::vector<Recorded>& recorded() const { return recorded_; }

 private:
  RecordedValue value_of(const Expression& expression, const CarState& state, double elapsed_s) const;
  bool holds(const Expression& expression, const CarState& state, double elapsed_s) const;

  const ProgramSpec& program_;
  const double start_z_m_;
  const double start_energy_j_;
  int looks_ = 0;
  std::vector<Recorded> recorded_;
};

}  // namespace foldcar
