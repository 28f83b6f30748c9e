// Logs of untethered trials: what is recorded, fetched, kept and erased.
#include <unity.h>

#include <string>

#include "link_bench.h"

namespace foldcar {
namespace {

void an_untethered_trial_is_recorded_and_can_be_fetched() {
  Bench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStartUntethered);
  bench.run(19000);
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
  bench.run(2000);
  TEST_ASSERT_TRUE(bench.state() == State::kFinished);
  TEST_ASSERT_EQUAL_UINT(1, bench.board.logs.logs.size());
  const std::string& stored = bench.board.logs.logs[1];

  bench.host.received.clear();
  mavlink_log_request_list_t list{};
  list.target_system = list.target_component = 1;
  list.end = 0xFFFF;
  bench.run(40, bench.host.pack(mavlink_msg_log_request_list_encode_status, list));
  const auto entries = bench.host.all<mavlink_log_entry_t>(MAVLINK_MSG_ID_LOG_ENTRY, mavlink_msg_log_entry_decode);
  TEST_ASSERT_EQUAL_UINT(1, entries.size());
  TEST_ASSERT_EQUAL_UINT(1, entries[0].num_logs);
  TEST_ASSERT_EQUAL_UINT(stored.size(), entries[0].size);

  mavlink_log_request_data_t data{};
  data.target_system = data.target_component = 1;
  data.id = entries[0].id;
  data.count = UINT32_MAX;
  bench.run(8000, bench.host.pack(mavlink_msg_log_request_data_encode_status, data));
  std::string fetched;
  for (const auto& part : bench.host.all<mavlink_log_data_t>(MAVLINK_MSG_ID_LOG_DATA, mavlink_msg_log_data_decode)) {
    TEST_ASSERT_EQUAL_UINT(fetched.size(), part.ofs);
    fetched.append(reinterpret_cast<const char*>(part.data), part.count);
  }
  TEST_ASSERT_TRUE(fetched == stored);

  MavlinkHost reader;
  std::uint64_t last_us = 0;
  for (std::size_t at = 0; at < fetched.size();) {
    std::uint64_t t_us = 0;
    for (int i = 0; i < 8; ++i) t_us = (t_us << 8) | static_cast<std::uint8_t>(fetched[at++]);
    TEST_ASSERT_TRUE(t_us >= last_us);
    last_us = t_us;
    const std::size_t size = 12 + static_cast<std::uint8_t>(fetched[at + 1]);
    reader.receive(fetched.substr(at, size));
    at += size;
  }
  TEST_ASSERT_EQUAL_INT(0, reader.bad_count);
  TEST_ASSERT_EQUAL_UINT32(MAVLINK_MSG_ID_FOLDCAR_DESIGN, reader.received.front().msgid);
  TEST_ASSERT_UINT_WITHIN(2, 5 * 20, count_of(reader, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW));
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, reader.trials().back().end);
  TEST_ASSERT_EQUAL_UINT32(8, reader.trials().back().trial_id);
}

void the_newest_logs_are_kept_and_all_can_be_erased() {
  Bench bench;
  for (int i = 0; i < 6; ++i) {
    bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
    bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStartUntethered);
    bench.run(300);
    bench.answer(MAV_CMD_FOLDCAR_STOP_TRIAL, {});
    bench.run(60);
  }
  TEST_ASSERT_EQUAL_UINT(kLogsKept, bench.board.logs.logs.size());
  TEST_ASSERT_EQUAL_UINT(3, bench.board.logs.logs.begin()->first);
  mavlink_log_erase_t erase{};
  erase.target_system = 1;
  bench.run(20, bench.host.pack(mavlink_msg_log_erase_encode_status, erase));
  TEST_ASSERT_EQUAL_UINT(0, bench.board.logs.logs.size());
}

// What the log has no room for is told, in its last packet too.
void the_longest_trial_fits_its_log() {
  Bench bench;
  bench.board.imu.fitted = true;
  bench.board.imu.now.acceleration_m_s2 = {0.3f, -0.2f, 9.81f};
  bench.run(20, bench.host.set_parameter("TRIAL_MAX_S", 3600));
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 3600, 1, 9});
  for (int s = 0; s < 3602; ++s) {
    bench.run(1000);
    bench.host.received.clear();
    bench.board.servos.writes.resize(1);
  }
  const std::string& stored = bench.board.logs.logs[1];
  TEST_ASSERT_TRUE(stored.size() <= kLargestLog);
  TEST_ASSERT_TRUE(stored.size() > kLargestLog - 2048);
  MavlinkHost reader;
  reader.receive(stored.substr(stored.size() - 12 - MAVLINK_MSG_ID_FOLDCAR_TRIAL_LEN));
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, reader.trials().back().end);
  TEST_ASSERT_TRUE(reader.trials().back().log_lost > 3600 * 5 * 200 - kLargestLog);
  bench.run(1000);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_INCOMPLETE, bench.host.trials().back().log);
}

}  // namespace

void run_log_tests() {
  UnitySetTestFile(__FILE__);
  RUN_TEST(an_untethered_trial_is_recorded_and_can_be_fetched);
  RUN_TEST(the_newest_logs_are_kept_and_all_can_be_erased);
  RUN_TEST(the_longest_trial_fits_its_log);
}

}  // namespace foldcar
