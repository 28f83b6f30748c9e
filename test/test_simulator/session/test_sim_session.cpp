// Sessions of carsim: a trial by steps is the trial of a batch, the ground is that of the scene, pulses those of a run.
#include "../../carsim_lines.h"
#include "batch_session.h"
#include "multibody_engine.h"
#include "step_session.h"

#include <cmath>
#include <string>

// After the rest: Unity hides std::isnan behind a macro.
#include "../../suite.h"

using namespace foldcar;

namespace {

const MultibodyEngine& engine() {
  static const MultibodyEngine multibody;
  return multibody;
}

// The reply to each line as JSON; null if there is none.
template <typename Session>
json ask(Session& session, const json& line) {
  const auto reply = session.answer(1, line.dump());
  return reply ? json::parse(*reply) : json(nullptr);
}

StepSession started() {
  StepSession session(engine());
  TEST_ASSERT_TRUE(ask(session, body()).is_null());
  TEST_ASSERT_TRUE(ask(session, scene()).is_null());
  const json reply = ask(session, run());
  TEST_ASSERT_EQUAL_DOUBLE(0, reply["state"][0].get<double>());
  TEST_ASSERT_TRUE(reply["result"].is_null());
  return session;
}

// A scene with one of every kind of terrain.
json everything() {
  json line = scene();
  const char* const kFar[] = {
      R"({"kind": "ramp", "x_m": 6.0, "y_m": 0.0, "length_m": 0.4, "width_m": 0.4, "height_m": 0.1, "heading_rad": 0.0})",
      R"({"kind": "half_round", "x_m": 7.0, "y_m": 0.0, "length_m": 0.4, "width_m": 0.4, "height_m": 0.2,
          "heading_rad": 0.5})",
      R"({"kind": "hill", "x_m": 10.0, "y_m": 0.0, "sd_along_m": 0.2, "sd_across_m": 0.3, "height_m": 0.05,
          "heading_rad": 0.5})",
      R"({"kind": "pothole", "x_m": 20.0, "y_m": 0.0, "radius_m": 0.2, "depth_m": 0.03, "edge_m": 0.05})",
      R"({"kind": "rough", "x_m": 30.0, "y_m": 0.0, "length_m": 0.4, "width_m": 0.4, "heading_rad": 0.5, "height_sd_m": 0.01,
          "correlation_m": 0.1, "seed": 3})",
      R"({"kind": "patch", "x_m": 40.0, "y_m": 0.0, "length_m": 0.4, "width_m": 0.4, "heading_rad": 0.5, "friction": 0.1})"};
  for (const char* one : kFar) line["scene"]["terrain"].push_back(json::parse(one));
  return line;
}

}  // namespace

TEST(test_a_trial_by_steps_ends_as_in_a_batch) {
  BatchSession batch(engine(), false);
  ask(batch, body());
  ask(batch, scene());
  json whole = ask(batch, run());
  StepSession steps = started();
  TEST_ASSERT_TRUE(ask(steps, {{"advance", {{"to_s", 0.1}}}})["result"].is_null());
  const json result = ask(steps, {{"advance", {{"to_s", 10.0}}}})["result"];
  whole.erase("run");
  whole.erase("path");
  TEST_ASSERT_EQUAL_STRING(whole.dump().c_str(), result.dump().c_str());
}

TEST(test_the_rows_of_an_advance_are_its_steps) {
  StepSession session = started();
  const json state = ask(session, {{"advance", {{"to_s", 0.1}}}})["state"];
  const json rows = ask(session, {{"rows", json::object()}})["rows"];
  TEST_ASSERT_EQUAL_UINT(std::lround(0.1 / engine().step_s()), rows.size());
  TEST_ASSERT_EQUAL_STRING(state.dump().c_str(), rows.back().dump().c_str());
  const json result = ask(session, {{"end", {{"row", 2}}}})["result"];
  TEST_ASSERT_EQUAL_STRING("terminated", result["outcome"].get<std::string>().c_str());
  TEST_ASSERT_EQUAL_DOUBLE(rows[2][0].get<double>(), result["elapsed_time_s"].get<double>());
  TEST_ASSERT_TRUE(refuses(ask(session, {{"rows", json::object()}}), "no trial is under way"));
}

TEST(test_lines_that_no_step_can_follow_are_refused) {
  StepSession session = started();
  TEST_ASSERT_TRUE(refuses(ask(session, {{"end", {{"row", 1}}}}), "end.row: 1 is above the limit 0"));
  TEST_ASSERT_TRUE(refuses(ask(session, {{"advance", {{"to_s", -1.0}}}}), "advance.to_s: -1.0 is below the limit 0"));
  TEST_ASSERT_TRUE(refuses(ask(session, {{"heights", {}}}), "body, scene, run, advance, rows or end"));
  json other = run();
  other["run"]["scene"] = "t";
  TEST_ASSERT_TRUE(refuses(ask(session, other), "run.scene: no scene \"t\""));
}

TEST(test_heights_and_friction_are_those_of_every_kind_of_terrain) {
  BatchSession session(engine(), false);
  TEST_ASSERT_TRUE(ask(session, everything()).is_null());
  const json points = {{"id", "h"}, {"scene", "s"}, {"x_m", {0.0, 0.45, 6.1, 7.0, 10.0, 20.0, 40.0}},
                       {"y_m", {0.0, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0}}};
  const json reply = ask(session, {{"heights", points}});
  const double expected_m[] = {0, 0.0215, 0.075, 0.2, 0.05, -0.03, 0};
  for (std::size_t i = 0; i < std::size(expected_m); ++i) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected_m[i], reply["z_m"][i].get<double>());
    TEST_ASSERT_EQUAL_DOUBLE(i == 6 ? 0.1 : 0.6, reply["friction"][i].get<double>());
  }
  json uneven = points;
  uneven["y_m"] = {0.0};
  TEST_ASSERT_TRUE(refuses(ask(session, {{"heights", uneven}}), "heights.y_m: has 1 entries, x_m has 7"));
  uneven["scene"] = "t";
  uneven["x_m"] = {0.0};
  TEST_ASSERT_TRUE(refuses(ask(session, {{"heights", uneven}}), "heights.scene: no scene \"t\""));
  json fine = everything();
  fine["scene"]["terrain"][5]["correlation_m"] = 0.001;
  TEST_ASSERT_TRUE(refuses(ask(session, fine), "the limit of a scene is 4000000 nodes"));
}

TEST(test_pulses_stand_before_the_start_and_are_off_after_the_limit) {
  BatchSession session(engine(), false);
  const json reply = ask(session, {{"pulses", {{"id", "p"}, {"speed_m_s", 0.5}, {"time_limit_s", 1.0}}}});
  const json& changes = reply["changes"];
  TEST_ASSERT_EQUAL_DOUBLE(-0.25, changes[0][0].get<double>());
  for (std::size_t channel = 1; channel <= 8; ++channel) {
    TEST_ASSERT_EQUAL_DOUBLE(0, changes[0][channel].get<double>());
    TEST_ASSERT_EQUAL_DOUBLE(0, changes.back()[channel].get<double>());
  }
  TEST_ASSERT_DOUBLE_WITHIN(0.02, 1.0, changes.back()[0].get<double>());
  // Forward is a longer pulse on the left and, with servos mounted mirrored, a shorter one on the right.
  const json& last = changes[changes.size() - 2];
  TEST_ASSERT_TRUE(last[1].get<double>() > 1545 && last[2].get<double>() < 1455);
}
