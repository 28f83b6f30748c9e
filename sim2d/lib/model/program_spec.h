// What a scene's program says of a run: conditions that end it and values to record, as docs/carsim.md describes them.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace foldcar {

// One step of an expression in postfix order: it takes its operands from a stack and puts its value there.
struct Term {
  enum class Kind {
    kNumber,
    // The car's origin, its rise since the start, its attitude and motion; energy and time since the start.
    kX, kY, kRise, kHeading, kPitch, kRoll, kSpeed, kYawRate, kEnergy, kTime,
    kNegate, kAbs, kWrap, kNot,
    kAdd, kSubtract, kMultiply, kDivide, kMin, kMax,
    kLess, kLessEqual, kGreater, kGreaterEqual, kAnd, kOr,
    kDistance,      // of the car's origin from x, y, rise
    kDistanceFrom,  // of the point ahead, left and above of the car's origin from x, y, rise
    kInDisc,        // whether the car's origin is within radius of x, y in the ground plane
    kInPolygon,
  };
  Kind kind = Kind::kNumber;
  double number = 0;
  std::vector<double> polygon_m;  // x and y of each corner
};

// value: one number or truth, or the three numbers of a vector.
struct Expression {
  std::vector<Term> terms;
  bool truth = false;
  bool vector = false;
};

struct EndingSpec {
  Expression when;
  bool passed = false;  // whether a run that this ends has passed
};

struct RecordSpec {
  enum class Kind { kInitial, kFinal, kSeries };
  std::string name;
  Kind kind = Kind::kFinal;
  Expression value;
  std::string constant;  // JSON that stands for the value of every run, "" for none
};

// Of several endings that hold at one step the first counts.
struct ProgramSpec {
  std::vector<EndingSpec> endings;
  std::optional<double> time_limit_s;
  std::optional<Expression> verdict;  // decides whether a run has passed that an ending or the time limit ends
  std::vector<RecordSpec> records;
  double step_s = 0.25;  // between the values of a series
};

}  // namespace foldcar
