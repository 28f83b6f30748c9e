// The batch's input: what docs/carsim.md shows is taken, everything else is refused by name, nothing aborts.
#include "../../carsim_lines.h"
#include "batch_session.h"
#include "multibody_engine.h"
#include "side_view_engine.h"

#include <functional>
#include <string>
#include <utility>

// After the rest: Unity hides std::isnan behind a macro.
#include "../../suite.h"

using namespace foldcar;
using nlohmann::json;

namespace {

// The answer to a line in a session that knows body b and scene s; empty if there is none.
std::string answer(const std::string& line) {
  const MultibodyEngine engine;
  BatchSession session(engine, false);
  TEST_ASSERT_FALSE(session.answer(1, body().dump()).has_value());
  TEST_ASSERT_FALSE(session.answer(2, scene().dump()).has_value());
  return session.answer(3, line).value_or("");
}

bool is_error_naming(const std::string& reply, const std::string& words) {
  const json parsed = json::parse(reply);
  if (!parsed.contains("error")) return false;
  return parsed["error"]["message"].get<std::string>().find(words) != std::string::npos;
}

// Calls visit for each value anywhere below the root, with a copy of the line that it may change, and the value's parent.
void for_each_key(const json& line,
                  const std::function<void(json& changed, json& parent, const std::string& key)>& visit) {
  const json flat = line.flatten();
  for (const auto& [pointer_text, value] : flat.items()) {
    static_cast<void>(value);
    const json::json_pointer pointer(pointer_text);
    if (pointer.parent_pointer().empty()) continue;
    json changed = line;
    json& parent = changed[pointer.parent_pointer()];
    if (parent.is_object()) visit(changed, parent, pointer.back());
  }
}

}  // namespace

TEST(test_the_documented_lines_are_taken) {
  const json reply = json::parse(answer(run().dump()));
  TEST_ASSERT_EQUAL_STRING("r", reply["run"].get<std::string>().c_str());
  TEST_ASSERT_EQUAL_STRING("timeout", reply["outcome"].get<std::string>().c_str());
  // Time, place, three angles, and the angle of every hinge.
  TEST_ASSERT_EQUAL_UINT(7 + body()["body"]["hinges"].size(), reply["path"][0].size());
}

TEST(test_what_may_be_left_out_of_a_run_can_be) {
  json line = run();
  for (const char* key : {"yaw_rate_rad_s", "parameters", "path_interval_s"}) line["run"].erase(key);
  const json reply = json::parse(answer(line.dump()));
  TEST_ASSERT_TRUE(reply.contains("outcome"));
  TEST_ASSERT_FALSE(reply.contains("path"));
}

TEST(test_a_scene_may_have_no_goal) {
  const MultibodyEngine engine;
  BatchSession session(engine, false);
  session.answer(1, body().dump());
  json aimless = scene();
  aimless["scene"]["goal"] = nullptr;
  TEST_ASSERT_FALSE(session.answer(2, aimless.dump()).has_value());
  const json reply = json::parse(session.answer(3, run().dump()).value());
  TEST_ASSERT_TRUE(reply.contains("outcome") && reply["distance_to_target_m"].is_null());
}

// Each key of each line, missing, of a wrong type, too large, too small, and beside an unknown one.
TEST(test_every_key_is_named_with_what_is_wrong_about_it) {
  const auto refused = [](const json& changed, const std::string& words) {
    TEST_ASSERT_TRUE_MESSAGE(is_error_naming(answer(changed.dump()), words), words.c_str());
  };
  for (const json& line : {body(), scene(), run()}) {
    for_each_key(line, [&](json& changed, json& parent, const std::string& key) {
      const json value = parent[key];
      if (value.is_number()) {
        for (const double beyond : {1e9, -1e9}) {
          parent[key] = beyond;
          refused(changed, key + ": ");
        }
      }
      parent[key] = json::array({1});
      refused(changed, key + ": must be");
      parent[key] = value;
      parent["colour"] = 1;
      refused(changed, "colour: ");
      parent.erase("colour");
      parent.erase(key);
      for (const char* optional : {"yaw_rate_rad_s", "path_interval_s", "TRACK_M", "camber_rad", "contact_time_s",
                                   "supply_resistance_ohm"}) {
        if (key == optional) return;
      }
      refused(changed, key + ": is missing");
    });
  }
}

TEST(test_cars_that_cannot_be_are_refused) {
  const struct {
    const char* place;
    json value;
    const char* words;
  } kCars[] = {
      {"wheels/1/x_m", 0.05, "body.wheels: every left wheel needs a right one"},
      {"wheels/1/segment", 1, "body.wheels: every left wheel needs a right one"},
      {"wheels/1/segment", 2, "wheels.1.segment: 2.0 is above the limit 1"},
      {"hinges", json::array(), "body.hinges: has 0 entries"},
      {"segments/1/x_m", 0.06, "body.segments: must stand from front to back"},
      {"hinges/0/x_m", 0.06, "body.hinges.0.x_m: 0.06 is above the limit 0.051"},
      {"wheels/1/channel", 0, "channel 0 drives two wheels"},
      {"wheels", json::array(), "body.wheels: has 0 entries"},
      {"wheels/0/servo/direction", 0, "direction: must be -1 or 1"},
  };
  for (const auto& car : kCars) {
    json line = body();
    line[json::json_pointer(std::string("/body/") + car.place)] = car.value;
    TEST_ASSERT_TRUE_MESSAGE(is_error_naming(answer(line.dump()), car.words), car.words);
  }
}

// Multibody's and the side view's tyres are upright and hard.
TEST(test_tyres_that_only_mujoco_has_are_refused_by_name) {
  const MultibodyEngine multibody;
  const SideViewEngine side_view;
  for (const Engine* engine : {static_cast<const Engine*>(&multibody), static_cast<const Engine*>(&side_view)}) {
    for (const auto& [key, value] : {std::pair("camber_rad", -0.035), std::pair("contact_time_s", 0.02)}) {
      BatchSession session(*engine, false);
      json car = body();
      car["body"]["wheels"][1][key] = value;
      TEST_ASSERT_FALSE(session.answer(1, car.dump()).has_value());
      session.answer(2, scene().dump());
      const std::string words = std::string("body b: wheels.1.") + key + ": ";
      TEST_ASSERT_TRUE_MESSAGE(is_error_naming(session.answer(3, run().dump()).value(), words), words.c_str());
    }
  }
}

TEST(test_a_supply_that_servos_would_pull_down_is_refused) {
  json line = body();
  line["body"]["supply_resistance_ohm"] = 1;
  TEST_ASSERT_TRUE(is_error_naming(answer(line.dump()), "body.supply_resistance_ohm: 1.0 is above the limit 0.92"));
}

TEST(test_a_firmware_parameter_is_checked_by_the_firmwares_table) {
  json line = run();
  line["run"]["parameters"] = {{"TRACK_M", 50.0}};
  TEST_ASSERT_TRUE(is_error_naming(answer(line.dump()), "run.parameters.TRACK_M: 50.0"));
  line["run"]["parameters"] = {{"NO_SUCH", 1.0}};
  TEST_ASSERT_TRUE(is_error_naming(answer(line.dump()), "run.parameters.NO_SUCH"));
}

TEST(test_what_is_no_line_is_answered_too) {
  for (const char* line : {"", "nonsense", "[]", "{}", "{\"body\": 1}", "{\"run\": {\"id\": 1e999}}", "\xff\xfe", "{\"a\":",
                           "{\"body\": {}, \"run\": {}}", "[[[[[[[[[[[[[[[[[[", "null"}) {
    TEST_ASSERT_TRUE_MESSAGE(json::parse(answer(line)).contains("error"), line);
  }
  TEST_ASSERT_TRUE(is_error_naming(answer("{\"run\": {\"id\": \"a\", \"id\": \"b\"}}"), "stands twice"));
  TEST_ASSERT_TRUE(is_error_naming(answer(std::string(100000, '[')), "nested deeper"));
}

TEST(test_a_run_may_only_name_what_is_known) {
  json line = run();
  line["run"]["body"] = "other";
  TEST_ASSERT_TRUE(is_error_naming(answer(line.dump()), "run.body: no body \"other\""));
}

TEST(test_a_later_definition_replaces_an_earlier_one) {
  const MultibodyEngine engine;
  BatchSession session(engine, false);
  session.answer(1, body().dump());
  session.answer(2, scene().dump());
  const std::string before = *session.answer(3, run().dump());
  json heavier = body();
  heavier["body"]["segments"][0]["mass_kg"] = 0.5;
  session.answer(4, heavier.dump());
  TEST_ASSERT_TRUE(before != *session.answer(5, run().dump()));
}

// The numbers of a result are the rows of the metrics' table, in their order, after the outcome; one that a run does
// not have is null.
TEST(test_a_result_holds_the_metrics_of_the_table) {
  TrialResult result;
  double value = 0.5;
  for (const MetricInfo& metric : kMetrics) {
    std::visit([&](auto member) { result.*member = value; }, metric.member);
    value += 1;
  }
  const nlohmann::ordered_json object = result_object(result);
  TEST_ASSERT_EQUAL_UINT(1 + kMetrics.size(), object.size());
  auto item = object.begin();
  TEST_ASSERT_EQUAL_STRING("outcome", item.key().c_str());
  value = 0.5;
  for (const MetricInfo& metric : kMetrics) {
    ++item;
    TEST_ASSERT_EQUAL_STRING(metric.name, item.key().c_str());
    TEST_ASSERT_EQUAL_DOUBLE(value, item.value().get<double>());
    value += 1;
  }
  const nlohmann::ordered_json empty = result_object(TrialResult());
  for (const MetricInfo& metric : kMetrics) TEST_ASSERT_EQUAL_INT(metric.optional(), empty[metric.name].is_null());
}
