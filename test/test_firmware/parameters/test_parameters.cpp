// The parameter table and the values: names, limits, refusals, storage.
#include "../../suite.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include "../../recording_hal.h"
#include "parameters.h"

using namespace foldcar;

TEST(names_are_unique_upper_case_and_fit_a_flash_key) {
  for (const ParameterInfo& info : parameter_table()) {
    const std::size_t length = std::strlen(info.name);
    TEST_ASSERT_TRUE_MESSAGE(length >= 1 && length <= 15, info.name);
    const std::size_t allowed_length = std::strspn(info.name, "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_");
    TEST_ASSERT_EQUAL_UINT_MESSAGE(length, allowed_length, info.name);
    int count = 0;
    for (const ParameterInfo& other : parameter_table()) count += std::strcmp(info.name, other.name) == 0;
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, count, info.name);
    TEST_ASSERT_TRUE_MESSAGE(std::strlen(info.help) > 10, info.name);
  }
}

TEST(a_name_leads_to_its_typed_index_and_an_unknown_one_is_refused) {
  const auto is = [](const char* name, Parameter parameter) {
    TEST_ASSERT_TRUE_MESSAGE(find_parameter(name) == parameter, name);
    TEST_ASSERT_EQUAL_STRING(name, parameter_info(parameter).name);
  };
  is("WHEEL_RADIUS_M", Parameter::kWheelRadiusM);
  is("BATT_MIN_V", Parameter::kBattMinV);
  is("CMD_TIMEOUT_MS", Parameter::kCmdTimeoutMs);
  is("OE_WIRED", Parameter::kOeWired);
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
    const std::string prefix = "CH" + std::to_string(channel + 1) + "_";
    is((prefix + "SIDE").c_str(), channel_parameter(channel, ChannelParameter::kSide));
    is((prefix + "NEUTRAL_US").c_str(), channel_parameter(channel, ChannelParameter::kNeutralUs));
    is((prefix + "GAIN_US").c_str(), channel_parameter(channel, ChannelParameter::kGainUs));
  }
  Parameters parameters;
  for (const char* name : {"", "TRACK", "track_m", "CH0_SIDE", "CH9_SIDE", "TRACK_M_AND_MORE_THAN_FITS"}) {
    TEST_ASSERT_TRUE_MESSAGE(parameters.set(name, 1.0f) == SetResult::kUnknownName, name);
  }
}

TEST(limits_are_allowed_and_what_is_beyond_them_is_not) {
  for (const ParameterInfo& info : parameter_table()) {
    Parameters parameters;
    const Parameter index = *find_parameter(info.name);
    const float infinity = std::numeric_limits<float>::infinity();
    TEST_ASSERT_TRUE_MESSAGE(parameters.set(info.name, info.minimum) == SetResult::kOk, info.name);
    TEST_ASSERT_TRUE_MESSAGE(parameters.get(index) == info.minimum, info.name);
    TEST_ASSERT_TRUE_MESSAGE(parameters.set(info.name, info.maximum) == SetResult::kOk, info.name);
    const SetResult below = parameters.set(info.name, std::nextafter(info.minimum, -infinity));
    const SetResult above = parameters.set(info.name, std::nextafter(info.maximum, infinity));
    TEST_ASSERT_TRUE_MESSAGE(below == SetResult::kBelowMinimum, info.name);
    TEST_ASSERT_TRUE_MESSAGE(above == SetResult::kAboveMaximum, info.name);
    TEST_ASSERT_TRUE_MESSAGE(parameters.set(info.name, NAN) == SetResult::kNotANumber, info.name);
    TEST_ASSERT_TRUE_MESSAGE(parameters.set(info.name, infinity) == SetResult::kAboveMaximum, info.name);
    TEST_ASSERT_TRUE_MESSAGE(parameters.get(index) == info.maximum, "a refused value changed the old one");
  }
}

TEST(a_side_is_whole_and_a_direction_is_a_sign) {
  Parameters parameters;
  TEST_ASSERT_TRUE(parameters.set("CH1_SIDE", 1.5f) == SetResult::kNotAnInteger);
  TEST_ASSERT_TRUE(parameters.set("CH1_DIRECTION", 0.0f) == SetResult::kNotASign);
  TEST_ASSERT_TRUE(parameters.set("CH1_DIRECTION", 0.5f) == SetResult::kNotASign);
  TEST_ASSERT_TRUE(parameters.set("CH1_DIRECTION", -1.0f) == SetResult::kOk);
}

TEST(values_survive_storage_and_what_is_beyond_the_limits_is_not_taken) {
  SimStorage storage;
  Parameters written;
  written.set("TRACK_M", 0.2f);
  written.set("CH3_NEUTRAL_US", 1512.5f);
  TEST_ASSERT_TRUE(written.save(storage, Parameter::kTrackM));
  TEST_ASSERT_TRUE(written.save(storage, channel_parameter(2, ChannelParameter::kNeutralUs)));
  TEST_ASSERT_EQUAL_UINT(2, storage.values.size());

  Parameters read;
  TEST_ASSERT_EQUAL_UINT(0, read.load(storage));
  for (const ParameterInfo& info : parameter_table()) {
    const Parameter index = *find_parameter(info.name);
    TEST_ASSERT_TRUE_MESSAGE(read.get(index) == written.get(index), info.name);
  }
  storage.accepts = false;
  TEST_ASSERT_FALSE(written.save(storage, Parameter::kTrackM));

  storage.values = {{"TRACK_M", -1.0f}, {"STAGGER_MS", NAN}, {"BATT_MIN_V", 3.0f}};
  Parameters defaults;
  TEST_ASSERT_EQUAL_UINT(2, defaults.load(storage));
  TEST_ASSERT_EQUAL_FLOAT(0.111f, defaults.get(Parameter::kTrackM));
  TEST_ASSERT_EQUAL_FLOAT(3.0f, defaults.get(Parameter::kBattMinV));
}
