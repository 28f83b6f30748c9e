// Logs of untethered trials: what is recorded, fetched, kept and erased.
#include "../../suite.h"

#include <random>
#include <string>

#include "link_bench.h"

using namespace foldcar;

TEST(an_untethered_trial_is_recorded_and_can_be_fetched) {
  LinkBench bench;
  bench.start(kStartUntethered);
  bench.run(19000);
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
  bench.run(2000);
  TEST_ASSERT_TRUE(bench.state() == State::kFinished);
  TEST_ASSERT_EQUAL_UINT(1, bench.board.logs.logs.size());
  const std::string& stored = bench.board.logs.logs[1];

  bench.host.received.clear();
  bench.run(40, bench.host.request_log_list());
  const auto entries = bench.host.all<mavlink_log_entry_t>(MAVLINK_MSG_ID_LOG_ENTRY, mavlink_msg_log_entry_decode);
  TEST_ASSERT_EQUAL_UINT(1, entries.size());
  TEST_ASSERT_EQUAL_UINT(1, entries[0].num_logs);
  TEST_ASSERT_EQUAL_UINT(stored.size(), entries[0].size);

  bench.run(8000, bench.host.request_log_data(entries[0].id));
  std::string fetched;
  for (const auto& part : bench.host.all<mavlink_log_data_t>(MAVLINK_MSG_ID_LOG_DATA, mavlink_msg_log_data_decode)) {
    TEST_ASSERT_EQUAL_UINT(fetched.size(), part.ofs);
    fetched.append(reinterpret_cast<const char*>(part.data), part.count);
  }
  TEST_ASSERT_TRUE(fetched == stored);

  MavlinkHost reader;
  TEST_ASSERT_TRUE(reader.receive_log(fetched));
  TEST_ASSERT_EQUAL_UINT32(MAVLINK_MSG_ID_FOLDCAR_DESIGN, reader.received.front().msgid);
  TEST_ASSERT_UINT_WITHIN(2, 5 * 20, count_of(reader, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW));
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, reader.trials().back().end);
  TEST_ASSERT_EQUAL_UINT32(8, reader.trials().back().trial_id);
}

// Without storage for logs an untethered trial is refused.
TEST(the_newest_logs_are_kept_and_all_can_be_erased) {
  LinkBench bench;
  for (int i = 0; i < 6; ++i) {
    bench.start(kStartUntethered);
    bench.run(300);
    bench.answer(MAV_CMD_FOLDCAR_STOP_TRIAL, {});
    bench.run(60);
  }
  TEST_ASSERT_EQUAL_UINT(kLogsKept, bench.board.logs.logs.size());
  TEST_ASSERT_EQUAL_UINT(3, bench.board.logs.logs.begin()->first);
  bench.run(100, bench.host.erase_logs());
  TEST_ASSERT_EQUAL_UINT(0, bench.board.logs.logs.size());
  bench.board.logs.fitted = false;
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, bench.start(kStartUntethered).result);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.start(kStart).result);
}

TEST(a_list_begins_with_the_oldest_log_although_numbers_wrap_around) {
  LinkBench bench;
  bench.board.logs.logs = {{1, "second"}, {65535, "first"}};
  bench.run(100, bench.host.request_log_list());
  const auto entries = bench.host.all<mavlink_log_entry_t>(MAVLINK_MSG_ID_LOG_ENTRY, mavlink_msg_log_entry_decode);
  TEST_ASSERT_EQUAL_UINT(2, entries.size());
  TEST_ASSERT_EQUAL_UINT(65535, entries[0].id);
  TEST_ASSERT_EQUAL_UINT(1, entries[1].id);
  TEST_ASSERT_EQUAL_UINT(2, entries[1].num_logs);
  TEST_ASSERT_EQUAL_UINT(6, entries[1].size);
}

TEST(a_log_that_is_added_while_logs_are_erased_stays) {
  LinkBench bench;
  bench.board.logs.logs = {{65534, "a"}, {65535, "b"}, {1, "c"}};
  bench.run(10, bench.host.erase_logs());
  TEST_ASSERT_TRUE(bench.board.logs.logs.size() < 3);
  bench.board.logs.logs[2] = "added";
  bench.run(100);
  TEST_ASSERT_EQUAL_UINT(1, bench.board.logs.logs.size());
  TEST_ASSERT_TRUE(bench.board.logs.logs[2] == "added");
}

TEST(the_longest_trial_fits_its_log) {
  LinkBench bench;
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
  TEST_ASSERT_TRUE(stored.size() <= kLogSize);
  MavlinkHost reader;
  reader.receive(stored.substr(stored.size() - 12 - MAVLINK_MSG_ID_FOLDCAR_TRIAL_LEN));
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, reader.trials().back().end);
  TEST_ASSERT_EQUAL_UINT32(0, reader.trials().back().log_lost);
  bench.run(1000);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.host.trials().back().log);
}
