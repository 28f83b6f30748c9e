// The batch's input: what docs/carsim.md shows is taken, everything else is refused by name, nothing aborts.
#include "../../carsim_lines.h"
#include "batch_session.h"
#include "multibody_engine.h"
#include "side_view_engine.h"

#include <functional>
#include <set>
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
  TEST_ASSERT_FALSE(reply["distance_to_target_m"].is_null());
}

// Each key of each line, missing, of a wrong type, too large, too small, and beside an unknown one.
TEST(test_every_key_is_named_with_what_is_wrong_about_it) {
  const auto refused = [](const json& changed, const std::string& words) {
    TEST_ASSERT_TRUE_MESSAGE(refuses(json::parse(answer(changed.dump())), words), words.c_str());
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
      const std::set<std::string> kOptional{"yaw_rate_rad_s", "path_interval_s", "TRACK_M", "camber_rad",
                                            "contact_time_s", "supply_resistance_ohm"};
      if (kOptional.count(key) == 0) return refused(changed, key + ": is missing");
      TEST_ASSERT_TRUE_MESSAGE(answer(changed.dump()).find("\"error\"") == std::string::npos, key.c_str());
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
      {"supply_resistance_ohm", 1, "body.supply_resistance_ohm: 1.0 is above the limit 0.92"},
  };
  for (const auto& car : kCars) {
    json line = body();
    line[json::json_pointer(std::string("/body/") + car.place)] = car.value;
    TEST_ASSERT_TRUE_MESSAGE(refuses(json::parse(answer(line.dump())), car.words), car.words);
  }
}

TEST(test_a_wheel_without_servo_is_taken) {
  json line = body();
  line["body"]["wheels"][0].erase("servo");
  TEST_ASSERT_TRUE(answer(line.dump()).empty());
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
      TEST_ASSERT_TRUE_MESSAGE(refuses(json::parse(session.answer(3, run().dump()).value()), words), words.c_str());
    }
  }
}

TEST(test_a_firmware_parameter_is_checked_by_the_firmwares_table) {
  json line = run();
  line["run"]["parameters"] = {{"TRACK_M", 50.0}};
  TEST_ASSERT_TRUE(refuses(json::parse(answer(line.dump())), "run.parameters.TRACK_M: 50.0"));
  line["run"]["parameters"] = {{"NO_SUCH", 1.0}};
  TEST_ASSERT_TRUE(refuses(json::parse(answer(line.dump())), "run.parameters.NO_SUCH"));
}

TEST(test_what_is_no_line_is_answered_too) {
  for (const char* line : {"", "nonsense", "[]", "{}", "{\"body\": 1}", "{\"run\": {\"id\": 1e999}}", "\xff\xfe", "{\"a\":",
                           "{\"body\": {}, \"run\": {}}", "[[[[[[[[[[[[[[[[[[", "null"}) {
    TEST_ASSERT_TRUE_MESSAGE(json::parse(answer(line)).contains("error"), line);
  }
  TEST_ASSERT_TRUE(refuses(json::parse(answer("{\"run\": {\"id\": \"a\", \"id\": \"b\"}}")), "stands twice"));
  TEST_ASSERT_TRUE(refuses(json::parse(answer(std::string(100000, '['))), "nested deeper"));
}

TEST(test_a_later_definition_replaces_an_earlier_one_and_a_scene_may_have_no_goal) {
  const MultibodyEngine engine;
  BatchSession session(engine, false);
  session.answer(1, body().dump());
  session.answer(2, scene().dump());
  const std::string before = *session.answer(3, run().dump());
  json heavier = body(), aimless = scene();
  heavier["body"]["segments"][0]["mass_kg"] = 0.5;
  session.answer(4, heavier.dump());
  TEST_ASSERT_TRUE(before != *session.answer(5, run().dump()));
  aimless["scene"]["goal"] = nullptr;
  session.answer(6, aimless.dump());
  TEST_ASSERT_TRUE(json::parse(*session.answer(7, run().dump()))["distance_to_target_m"].is_null());
}
