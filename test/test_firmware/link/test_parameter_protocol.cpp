// MAVLink's parameter protocol: list, read, set, and a link that loses a fifth of its bytes.
#include "../../suite.h"

#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <string>

#include "link_bench.h"
#include "packet_parser.h"

using namespace foldcar;

// The bytes that arrive if each is lost with probability loss.
static std::string through(const std::string& bytes, double loss, std::mt19937_64& random) {
  std::bernoulli_distribution is_lost(loss);
  std::string arrived;
  for (const char byte : bytes) {
    if (!is_lost(random)) arrived += byte;
  }
  return arrived;
}

static void assert_default_of_the_table(std::size_t index, const mavlink_param_value_t& value) {
  TEST_ASSERT_EQUAL_UINT(index, value.param_index);
  TEST_ASSERT_EQUAL_UINT(kParameterCount, value.param_count);
  TEST_ASSERT_EQUAL_UINT(MAV_PARAM_TYPE_REAL32, value.param_type);
  TEST_ASSERT_EQUAL_STRING_LEN(parameter_table()[index].name, value.param_id, 16);
  TEST_ASSERT_TRUE(value.param_value == parameter_table()[index].default_value);
}

TEST(the_parameter_list_is_that_of_the_table) {
  LinkBench bench;
  bench.run(200, bench.host.request_list());
  const auto values = bench.host.parameters();
  TEST_ASSERT_EQUAL_UINT(kParameterCount, values.size());
  for (std::size_t i = 0; i < values.size(); ++i) assert_default_of_the_table(i, values[i]);
}

// 4 % of the requests and 0.03 % of the values arrive undamaged; the host repeats its request until it has all values. Some
// of so many damaged packets pass a checksum of 16 bits, so a value counts when it has arrived twice.
TEST(the_parameter_list_is_complete_over_a_link_that_drops_a_fifth_of_the_bytes) {
  LinkBench bench;
  std::mt19937_64 random(1);
  PacketParser reader;  // the reference parser loses whole packets behind each damaged one
  std::map<std::string, int> times_seen;
  std::map<std::size_t, mavlink_param_value_t> known;
  for (int polls = 0; known.size() < kParameterCount && polls < 5000000; ++polls) {
    bench.board.link.incoming += through(bench.host.request_list(), 0.2, random);
    bench.board.clock.time_us += 4000;
    bench.firmware.poll();
    const std::string arrived = through(bench.board.link.outgoing, 0.2, random);
    bench.board.link.outgoing.clear();
    bench.board.servos.writes.clear();
    for (std::size_t fed = 0; fed < arrived.size();) {
      const auto* bytes = reinterpret_cast<const std::uint8_t*>(arrived.data());
      fed += reader.feed(bytes + fed, arrived.size() - fed, bench.board.clock.time_us);
      mavlink_message_t message;
      while (reader.next(message, bench.board.clock.time_us)) {
        if (message.msgid != MAVLINK_MSG_ID_PARAM_VALUE) continue;
        mavlink_param_value_t value;
        mavlink_msg_param_value_decode(&message, &value);
        const std::string content(reinterpret_cast<const char*>(&value), sizeof value);
        if (++times_seen[content] == 2) known[value.param_index] = value;
      }
    }
  }
  TEST_ASSERT_EQUAL_UINT(kParameterCount, known.size());
  for (const auto& [index, value] : known) assert_default_of_the_table(index, value);
}

TEST(a_parameter_is_set_or_the_value_that_holds_comes_back_with_the_reason) {
  LinkBench bench;
  const auto value_after = [&bench](const char* name, float value) {
    bench.host.received.clear();
    bench.run(20, bench.host.set_parameter(name, value));
    TEST_ASSERT_EQUAL_UINT(1, bench.host.parameters().size());
    return bench.host.parameters().front().param_value;
  };
  TEST_ASSERT_EQUAL_FLOAT(0.2f, value_after("TRACK_M", 0.2f));
  TEST_ASSERT_EQUAL_UINT(0, bench.host.texts().size());
  TEST_ASSERT_EQUAL_FLOAT(0.2f, bench.board.storage.values["TRACK_M"]);
  TEST_ASSERT_EQUAL_FLOAT(0.2f, value_after("TRACK_M", -1.0f));
  TEST_ASSERT_EQUAL_STRING("TRACK_M is below its minimum", bench.last_text().c_str());
  TEST_ASSERT_EQUAL_FLOAT(0.2f, value_after("TRACK_M", NAN));
  TEST_ASSERT_EQUAL_FLOAT(1.0f, value_after("CH1_SIDE", 1.5f));
  TEST_ASSERT_EQUAL_STRING("CH1_SIDE is not a whole number", bench.last_text().c_str());
  bench.board.storage.accepts = false;
  TEST_ASSERT_EQUAL_FLOAT(0.3f, value_after("TRACK_M", 0.3f));
  TEST_ASSERT_EQUAL_STRING("TRACK_M is set, but could not be saved", bench.last_text().c_str());
  bench.board.storage.accepts = true;
  bench.host.received.clear();
  bench.run(20, bench.host.set_parameter("NO_SUCH_NAME_16X", 1.0f));
  TEST_ASSERT_EQUAL_UINT(0, bench.host.parameters().size());
  TEST_ASSERT_EQUAL_STRING("NO_SUCH_NAME_16X is not a parameter", bench.last_text().c_str());
  bench.start(kStart);
  TEST_ASSERT_EQUAL_FLOAT(0.3f, value_after("TRACK_M", 0.1f));
  TEST_ASSERT_EQUAL_STRING("TRACK_M is not set: wheels are driven", bench.last_text().c_str());
}

TEST(a_program_is_told_the_reason_of_a_refused_setting_by_its_number) {
  LinkBench bench;
  const auto reason_after = [&bench](const char* name, float value) {
    bench.host.received.clear();
    bench.run(20, bench.host.set_parameter(name, value));
    const auto refusals = bench.host.all<mavlink_foldcar_param_refused_t>(MAVLINK_MSG_ID_FOLDCAR_PARAM_REFUSED,
                                                                          mavlink_msg_foldcar_param_refused_decode);
    if (refusals.empty()) return Refusal::kNone;
    TEST_ASSERT_EQUAL_UINT(1, refusals.size());
    TEST_ASSERT_EQUAL_STRING_LEN(name, refusals[0].param_id, 16);
    return static_cast<Refusal>(refusals[0].reason);
  };
  TEST_ASSERT_TRUE(reason_after("TRACK_M", 0.2f) == Refusal::kNone);
  TEST_ASSERT_TRUE(reason_after("TRACK_M", -1.0f) == Refusal::kBelowMinimum);
  TEST_ASSERT_TRUE(reason_after("TRACK_M", 9.0f) == Refusal::kAboveMaximum);
  TEST_ASSERT_TRUE(reason_after("TRACK_M", NAN) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(reason_after("CH1_SIDE", 1.5f) == Refusal::kNotAnInteger);
  TEST_ASSERT_TRUE(reason_after("CH1_DIRECTION", 0.5f) == Refusal::kNotASign);
  TEST_ASSERT_TRUE(reason_after("NO_SUCH_NAME_16X", 1.0f) == Refusal::kUnknownParameter);
  bench.board.storage.accepts = false;
  TEST_ASSERT_TRUE(reason_after("TRACK_M", 0.3f) == Refusal::kNotSaved);
  bench.start(kStart);
  TEST_ASSERT_TRUE(reason_after("TRACK_M", 0.1f) == Refusal::kRunning);
}

TEST(one_parameter_is_read_by_index_or_by_name) {
  LinkBench bench;
  mavlink_param_request_read_t request{};
  request.target_system = 1;
  request.param_index = 3;
  bench.run(20, bench.host.pack(mavlink_msg_param_request_read_encode_status, request));
  request.param_index = -1;
  std::memcpy(request.param_id, "CH8_GAIN_US", 11);
  bench.run(20, bench.host.pack(mavlink_msg_param_request_read_encode_status, request));
  request.param_index = 1000;
  bench.run(20, bench.host.pack(mavlink_msg_param_request_read_encode_status, request));
  const auto values = bench.host.parameters();
  TEST_ASSERT_EQUAL_UINT(2, values.size());
  TEST_ASSERT_EQUAL_STRING("SLEW_US_PER_S", values[0].param_id);
  TEST_ASSERT_EQUAL_STRING("CH8_GAIN_US", values[1].param_id);
}
