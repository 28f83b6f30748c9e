// car.json: what is accepted, what is refused with which message, and the parameters that follow.
//
// Where ArduinoJson is installed, which PlatformIO's registry has, the board's reading is compared with the simulator's.
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>

#include "../../recording_hal.h"
#include "car_json.h"
#if __has_include(<ArduinoJson.h>)
#include "design_json.h"
#define FOLDCAR_HAS_ARDUINO_JSON 1
#endif
// Its macros would break the JSON library.
#include "../../suite.h"

using namespace foldcar;
using nlohmann::json;

namespace {

json good() {
  return json::parse(R"({"format": 1, "name": "w95", "hash": "0123456789abcdef", "wheel_radius_m": 0.05,
    "track_m": 0.2, "length_m": 0.2, "width_m": 0.095, "mass_kg": 0.3,
    "wheels": [{"channel": 1, "side": "right", "direction": -1, "x_m": 0.07},
               {"channel": 6, "side": "left", "direction": 1}],
    "parameters": {"WHEEL_MAX_RAD_S": 9.5, "CH1_NEUTRAL_US": 1490}})");
}

// The board's reading of a text; the simulator's where ArduinoJson is not installed.
DesignResult read_on_board(const std::string& text) {
#ifdef FOLDCAR_HAS_ARDUINO_JSON
  return read_design_json(text.data(), text.size());
#else
  return read_car_json(text);
#endif
}

void expect_same_design(const DesignResult& one, const DesignResult& other) {
  TEST_ASSERT_TRUE(one.source == other.source);
  TEST_ASSERT_EQUAL_STRING(one.problem, other.problem);
  TEST_ASSERT_EQUAL_STRING(one.design.name, other.design.name);
  TEST_ASSERT_EQUAL_STRING(one.design.hash, other.design.hash);
  TEST_ASSERT_EQUAL_FLOAT(one.design.wheel_radius_m, other.design.wheel_radius_m);
  TEST_ASSERT_EQUAL_FLOAT(one.design.track_m, other.design.track_m);
  TEST_ASSERT_TRUE(one.design.sides == other.design.sides);
  TEST_ASSERT_TRUE(one.design.directions == other.design.directions);
  for (std::size_t i = 0; i < kParameterCount; ++i) {
    TEST_ASSERT_EQUAL(one.design.defaults[i].has_value(), other.design.defaults[i].has_value());
    if (one.design.defaults[i]) TEST_ASSERT_EQUAL_FLOAT(*one.design.defaults[i], *other.design.defaults[i]);
  }
}

void expect_refused(const json& file, const char* problem) {
  const DesignResult result = read_car_json(file.dump());
  TEST_ASSERT_EQUAL_STRING(problem, read_on_board(file.dump()).problem);
  TEST_ASSERT_EQUAL_STRING(problem, result.problem);
  TEST_ASSERT_TRUE(result.source == DesignSource::kRefused);
  TEST_ASSERT_EQUAL_STRING("", result.design.name);
}

void expect_refused(const char* key, const json& value, const char* problem) {
  json file = good();
  file[key] = value;
  expect_refused(file, problem);
}

}  // namespace

TEST(the_design_comes_before_the_flash_where_it_must_and_behind_it_where_it_may) {
  SimStorage storage;
  storage.values = {{"TRACK_M", 0.3f}, {"WHEEL_MAX_RAD_S", 8.0f}, {"CH2_SIDE", 1.0f},
                    {"CH1_DIRECTION", 1.0f}, {"CH6_DIRECTION", -1.0f}};
  Parameters parameters;
  const DesignResult result = read_car_json(good().dump());
  TEST_ASSERT_EQUAL_STRING("", result.problem);
  TEST_ASSERT_TRUE(result.source == DesignSource::kFile);
  TEST_ASSERT_EQUAL_STRING("w95", result.design.name);
  TEST_ASSERT_EQUAL_STRING("0123456789abcdef", result.design.hash);
  TEST_ASSERT_EQUAL_UINT(0, configure(parameters, result, storage));
  TEST_ASSERT_EQUAL_FLOAT(0.2f, parameters.get(Parameter::kTrackM));
  TEST_ASSERT_EQUAL_FLOAT(0.05f, parameters.get(Parameter::kWheelRadiusM));
  TEST_ASSERT_EQUAL_FLOAT(8.0f, parameters.get(Parameter::kWheelMaxRadS));
  TEST_ASSERT_EQUAL_FLOAT(1490.0f, parameters.get(0, ChannelParameter::kNeutralUs));
  const float sides[] = {2, 0, 0, 0, 0, 1, 0, 0};
  for (std::size_t i = 0; i < kChannelCount; ++i) {
    TEST_ASSERT_EQUAL_FLOAT(sides[i], parameters.get(i, ChannelParameter::kSide));
    TEST_ASSERT_TRUE(parameters.set(channel_parameter(i, ChannelParameter::kSide), 1.0f) == SetResult::kFixed);
  }
  // Both differ from the table's defaults, and from a value that was saved.
  TEST_ASSERT_EQUAL_FLOAT(-1.0f, parameters.get(0, ChannelParameter::kDirection));
  TEST_ASSERT_EQUAL_FLOAT(1.0f, parameters.get(5, ChannelParameter::kDirection));
  for (const std::size_t channel : {0u, 5u}) {
    const Parameter direction = channel_parameter(channel, ChannelParameter::kDirection);
    TEST_ASSERT_TRUE(parameters.set(direction, 1.0f) == SetResult::kFixed);
  }
  Parameters without_design;
  configure(without_design, DesignResult{}, storage);
  TEST_ASSERT_EQUAL_FLOAT(0.3f, without_design.get(Parameter::kTrackM));
  TEST_ASSERT_TRUE(without_design.set("TRACK_M", 0.2f) == SetResult::kOk);
}

TEST(every_missing_key_is_named) {
  for (const char* key : {"format", "name", "hash", "wheel_radius_m", "track_m"}) {
    json file = good();
    file.erase(key);
    expect_refused(file, (std::string("car.json: ") + key + " is missing").c_str());
  }
  json file = good();
  file.erase("wheels");
  expect_refused(file, "car.json: wheels has none on the left or on the right");
}

TEST(a_wrong_value_is_named_with_its_limit) {
  expect_refused("format", 2, "car.json: format is not 1, the format this firmware knows");
  expect_refused("name", "", "car.json: name is empty or longer than 32 bytes");
  expect_refused("hash", "0123456789ABCDEF", "car.json: hash is not 16 hexadecimal digits");
  expect_refused("track_m", 5, "car.json: track_m is above its maximum");
  expect_refused("wheel_radius_m", "big", "car.json: wheel_radius_m is unknown or not of its type");
  expect_refused("colour", "red", "car.json: colour is unknown or not of its type");
  expect_refused("geometry", json{{"a", 1}}, "car.json: geometry.a is unknown");
  expect_refused("parameters", json{{"NO_SUCH", 1}}, "car.json: parameters.NO_SUCH is not a parameter");
  expect_refused("parameters", json{{"STAGGER_MS", -1}}, "car.json: parameters.STAGGER_MS is below its minimum");
  expect_refused("parameters", json{{"CH3_SIDE", 1}},
                 "car.json: parameters.CH3_SIDE follows from wheels, wheel_radius_m and track_m");
}

TEST(wrong_wheels_are_named) {
  const auto refused = [](std::size_t index, const char* key, const json& value, const char* problem) {
    json file = good();
    file["wheels"][index][key] = value;
    expect_refused(file, problem);
  };
  refused(1, "channel", 9, "car.json: wheels[1].channel is not a whole number from 1 to 8");
  refused(0, "channel", 1.5, "car.json: wheels[0].channel is not a whole number from 1 to 8");
  refused(1, "channel", 1, "car.json: wheels[1].channel drives another wheel already");
  refused(0, "side", "middle", "car.json: wheels[0].side is neither left nor right");
  refused(1, "direction", 0, "car.json: wheels[1].direction is neither -1 nor 1");
  refused(1, "size", 0, "car.json: wheels[1].size is unknown or not of its type");
  refused(1, "side", "right", "car.json: wheels has none on the left or on the right");
  json file = good();
  file["wheels"][1].erase("side");
  expect_refused(file, "car.json: wheels[1].channel needs side and direction beside it");
  file = good();
  for (int i = 0; i < 7; ++i) file["wheels"].push_back({{"channel", 1}});
  expect_refused(file, "car.json: wheels[8].channel is one wheel too many");
  file = good();
  file["wheels"] = json{{"side", "left"}};
  expect_refused(file, "car.json: wheels.side is unknown or not of its type");
  file["wheels"] = json::array({1, 2});
  expect_refused(file, "car.json: wheels[0]. is unknown or not of its type");
}

// Libraries forgive different things: what is not JSON to the letter is refused by both.
TEST(what_is_not_json_to_the_letter_is_refused_on_the_board_as_in_the_simulator) {
  const std::string text = good().dump();
  const auto with = [&text](const std::string& from, const std::string& to) {
    std::string changed = text;
    return changed.replace(changed.find(from), from.size(), to);
  };
  const auto same = [](const std::string& file, const char* problem) {
    TEST_ASSERT_EQUAL_STRING(problem, read_car_json(file).problem);
    expect_same_design(read_car_json(file), read_on_board(file));
  };
  for (const char* number : {"+0.06", ".06", "06", "6.", "0x1", "1e", "1e+", "1e999", "-", "NaN", "Infinity", "0.06f", "1_0",
                             "0.050000000000000000000000000000001", "tru", "nul", "True", "--1", "1 2", "", "\xB2"}) {
    same(with("0.05", number), "car.json: is not a JSON object");
  }
  for (const char* name : {"'w95'", "w95", "\"w\n95\"", "\"w\t95\"", "\"\\q\"", "\"\\u12g4\"", "\"\\u0000\"", "\"\\uD800\"",
                           "\"\\uDC00\"", "\"\\uD800\\u0041\"", "\"K\xE4""fer\"", "\"\xC0\xAF\"", "\"\xED\xA0\x80\"",
                           "\"\xF4\x90\x80\x80\"", "\"\xE2\x82\"", "\"\\'\"", "\"w95", "\"a\" \"b\""}) {
    same(with("\"w95\"", name), "car.json: is not a JSON object");
  }
  for (const std::string& file : {text + std::string(1, '\0'), text + "//", "/**/" + text, "\xEF\xBB\xBF" + text, text + ",",
                                  with("{", "{,"), with("]", ",]"), with("[{", "[,{"), with(":", "="), with(":", " "),
                                  with("\"w95\"", "[[[[[[[[[]]]]]]]]]"), with("\"format\"", "format"),
                                  with(",", ", \v"), text.substr(0, text.size() - 1) + ",}"}) {
    same(file, "car.json: is not a JSON object");
  }
  same(with("0.05", "5.0E-02"), "");
  same(with("\"w95\"", "\"K\xC3\xA4""fer \\u00e4\\uD83D\\uDE97 \xF0\x9F\x9A\x97\""), "");
  same(with("\"w95\"", "[[[[[[[]]]]]]]"), "car.json: name[0]. is unknown or not of its type");
  same(" \t\r\n" + text + "\r\n", "");
}

// Every prefix of a valid file is refused; a file with a changed byte is either refused with a message or accepted. Board
// and simulator read damaged files alike.
TEST(damaged_files_are_refused_or_harmless_on_the_board_as_in_the_simulator) {
  const std::string text = good().dump();
  expect_same_design(read_car_json(good().dump(2) + " \n"), read_on_board(good().dump(2) + " \n"));
  for (std::size_t size = 0; size < text.size(); ++size) {
    const DesignResult cut_off = read_car_json(text.substr(0, size));
    TEST_ASSERT_TRUE(cut_off.source == DesignSource::kRefused);
    expect_same_design(cut_off, read_on_board(text.substr(0, size)));
  }
  for (const std::string& damaged : {text + "}", text + text, text + "x", "[" + text + "]", "[1]" + text,
                                     std::string("[1]"), std::string("null"), std::string(9000, ' '), std::string()}) {
    expect_same_design(read_car_json(damaged), read_on_board(damaged));
  }
  TEST_ASSERT_EQUAL_STRING("car.json: is not a JSON object", read_car_json("[1]").problem);
  TEST_ASSERT_EQUAL_STRING("car.json: is larger than 8192 bytes", read_car_json(std::string(9000, ' ')).problem);
  for (std::size_t i = 0; i < text.size(); ++i) {
    for (int byte = 0; byte < 256; ++byte) {
      std::string damaged = text;
      damaged[i] = static_cast<char>(byte);
      const DesignResult simulator = read_car_json(damaged), board = read_on_board(damaged);
      for (const DesignResult& result : {simulator, board}) {
        TEST_ASSERT_TRUE((result.source == DesignSource::kRefused) == (result.problem[0] != '\0'));
        TEST_ASSERT_TRUE(std::strlen(result.problem) < sizeof result.problem);
      }
      expect_same_design(simulator, board);
    }
  }
}
