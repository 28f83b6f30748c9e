// A scene's program beside a trial, on states whose values are known: geometry of distances and regions, order of endings,
// times of records.
#include <cmath>

#include "program_input.h"
#include "program_run.h"
#include "trial.h"

// After the rest: Unity hides std::isnan behind a macro.
#include "../../suite.h"

using namespace foldcar;
using nlohmann::json;

namespace {

ProgramSpec program(const char* endings, const char* records, const char* rest = R"("time_limit_s": null, "verdict": null)") {
  const std::string text = std::string(R"({"endings": [)") + endings + R"(], "records": [)" + records + "], " + rest +
                           R"(, "step_s": 0.25})";
  const json parsed = json::parse(text);
  return read_program(JsonReader(parsed, "scene.program"));
}

CarState at(double x_m, double y_m, double heading_rad = 0, double pitch_rad = 0, double roll_rad = 0) {
  CarState car;
  car.x_m = x_m;
  car.y_m = y_m;
  car.heading_rad = heading_rad;
  car.pitch_rad = pitch_rad;
  car.roll_rad = roll_rad;
  return car;
}

// The final value of an expression at a state that is 0.1 m higher than the start and has taken 2 J.
double value(const char* expression, CarState car) {
  const std::string record = std::string(R"({"name": "v", "kind": "final", "value": )") + expression + "}";
  const ProgramSpec spec = program("", record.c_str());
  CarState start;
  start.z_m = 0.06;
  start.consumed_energy_j = 1;
  car.z_m = 0.16;
  car.consumed_energy_j = 3;
  ProgramRun run(spec, start);
  run.record(car, 1.5, true);
  return run.recorded()[0].values[0][0];
}

bool holds(const char* condition, const CarState& car) { return value(condition, car) != 0; }

}  // namespace

TEST(test_distances_are_from_the_middle_or_from_a_point_of_the_car) {
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5, value(R"([0.3, 0, 0.1, "distance_m"])", at(0, 0.4)));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.1, value(R"([0, 0, 0, "distance_m"])", at(0, 0)));
  // Heading to the left, nose up by 30 degrees, then rolled by 90: its left side is up.
  const double left = M_PI / 2, up = M_PI / 6;
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, value(R"([0.2, 0, 0, 1, 0.17320508075688772, 0.2, "distance_from_m"])", at(1, 0, left, up)));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, value(R"([0, 0.2, 0, 0, 0, 0.3, "distance_from_m"])", at(0, 0, 0, 0, left)));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, value(R"([0, 0, 0.2, 0, -0.2, 0.1, "distance_from_m"])", at(0, 0, 0, 0, left)));
}

TEST(test_regions_are_of_the_ground) {
  TEST_ASSERT_TRUE(holds(R"([1, 0, 0.05, "in_disc"])", at(1.04, 0.02)));
  TEST_ASSERT_FALSE(holds(R"([1, 0, 0.05, "in_disc"])", at(1.04, 0.04)));
  const char* const kArrow = "[[0, 0, 2, 1, 0, 2, 1, 1]]";  // hollow on its left
  TEST_ASSERT_TRUE(holds(kArrow, at(1.5, 1)));
  TEST_ASSERT_TRUE(holds(kArrow, at(0.3, 0.25)));
  TEST_ASSERT_FALSE(holds(kArrow, at(0.5, 1)));
  TEST_ASSERT_FALSE(holds(kArrow, at(2.5, 1)));
  // On each edge and corner, as for Scenic.
  const char* const kSquare = "[[-1, -1, 1, -1, 1, 1, -1, 1]]";
  for (const double along : {-1.0, 0.5, 1.0}) {
    for (const double side : {-1.0, 1.0}) {
      TEST_ASSERT_TRUE(holds(kSquare, at(along, side)));
      TEST_ASSERT_TRUE(holds(kSquare, at(side, along)));
      TEST_ASSERT_FALSE(holds(kSquare, at(along, 1.0001 * side)));
      TEST_ASSERT_FALSE(holds(kSquare, at(1.0001 * side, along)));
    }
  }
}

TEST(test_arithmetic_is_in_postfix_order) {
  TEST_ASSERT_DOUBLE_WITHIN(1e-15, -4.5, value(R"(["time_s", 2, "*", 6, "-", "energy_j", "max", 6.5, "-"])", at(0, 0)));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, -1, value(R"(["heading_rad", "wrap_rad", "negate", "abs", "negate"])", at(0, 0, 2 * M_PI - 1)));
  TEST_ASSERT_TRUE(holds(R"(["x_m", 1, ">", "y_m", 1, "<", "and", false, "or", true, "and", "not", "not"])", at(2, 0)));
  TEST_ASSERT_FALSE(holds(R"(["x_m", 2, ">", "x_m", 2, "<", "or"])", at(2, 0)));
  TEST_ASSERT_TRUE(holds(R"(["x_m", 2, ">=", "x_m", 2, "<=", "and"])", at(2, 0)));
  bool refused = false;
  try {
    value(R"([1, "x_m", "/"])", at(0, 0));
  } catch (const TrialError&) {
    refused = true;
  }
  TEST_ASSERT_TRUE(refused);
}

TEST(test_the_first_ending_that_holds_counts_and_the_verdict_before_it) {
  const char* const kEndings =
      R"({"when": ["x_m", 2, ">"], "outcome": "terminated"}, {"when": ["x_m", 1, ">"], "outcome": "passed"})";
  const ProgramSpec spec = program(kEndings, "", R"("time_limit_s": 5, "verdict": null)");
  const ProgramRun run(spec, CarState{});
  TEST_ASSERT_FALSE(run.check(at(0.5, 0), 4.9).has_value());
  TEST_ASSERT_TRUE(run.check(at(1.5, 0), 1) == Outcome::kPassed);
  TEST_ASSERT_TRUE(run.check(at(2.5, 0), 1) == Outcome::kTerminated);
  TEST_ASSERT_TRUE(run.check(at(0.5, 0), 5) == Outcome::kTerminated);
  const ProgramSpec judged = program(kEndings, "", R"("time_limit_s": 5, "verdict": ["y_m", 0, ">"])");
  const ProgramRun judged_run(judged, CarState{});
  TEST_ASSERT_TRUE(judged_run.check(at(1.5, 0), 1) == Outcome::kTerminated);
  TEST_ASSERT_TRUE(judged_run.check(at(0.5, 1), 5) == Outcome::kPassed);
}

TEST(test_records_are_taken_at_the_start_at_looks_and_at_the_end) {
  const ProgramSpec spec = program("", R"({"name": "a", "kind": "initial", "value": ["x_m"]},
      {"name": "b", "kind": "series", "value": ["x_m", "y_m", "rise_m"]}, {"name": "c", "kind": "final", "value": ["x_m"]},
      {"name": "d", "kind": "final", "constant": {"k": [1]}})");
  ProgramRun run(spec, CarState{});
  for (int step = 0; step <= 150; ++step) run.record(at(step, 0), step / 240.0, step == 150);
  const auto& recorded = run.recorded();
  TEST_ASSERT_DOUBLE_WITHIN(0, 0, recorded[0].values.at(0).at(0));
  const std::vector<double> times = {0, 0.25, 0.5, 0.625};
  TEST_ASSERT_TRUE(recorded[1].times_s == times);
  TEST_ASSERT_EQUAL_size_t(3, recorded[1].values.back().size());
  TEST_ASSERT_DOUBLE_WITHIN(0, 150, recorded[2].values.at(0).at(0));
  TEST_ASSERT_EQUAL_STRING(R"({"k":[1]})", recorded[3].record->constant.c_str());
}
