// Flash that is slow, full or busy: no tick waits for it, and what is lost is told.
#include "../../suite.h"

#include <string>

#include "../../log_threads.h"
#include "slow_bench.h"

using namespace foldcar;

namespace {

// The packets of a log, which must be whole.
MavlinkHost read(const std::string& log) {
  MavlinkHost reader;
  TEST_ASSERT_TRUE(reader.receive_log(log));
  return reader;
}

// The size (bytes) of the log of such a trial with a flash that takes no time. Records that tell of a loss are up to 5 bytes
// longer.
std::size_t whole_size(float time_s) {
  SlowBench bench;
  bench.logs.slowness = 0.0;
  bench.drive(time_s);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.closed().log);
  return bench.logs.logs[1].size();
}

}  // namespace

// Programming flash stops both cores for 3 ms, so that a tick comes that much late; the next counts from its deadline. A trial
// of up to 130 s is recorded at 5 Hz, one of 600 s at 1 Hz.
TEST(a_tick_waits_for_a_page_of_flash_at_most) {
  for (const auto& [time_s, records] : {std::pair(130.0f, 650u), std::pair(600.0f, 600u)}) {
    SlowBench bench;
    bench.drive(time_s);
    TEST_ASSERT_EQUAL_INT(0, bench.erased_while_driving);
    TEST_ASSERT_TRUE(bench.programmed_while_driving > 100);
    TEST_ASSERT_TRUE(bench.longest_gap_while_driving_us <= 24000);
    TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.closed().log);
    const MavlinkHost reader = read(bench.logs.logs[1]);
    TEST_ASSERT_UINT_WITHIN(2, records, count_of(reader, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW));
    TEST_ASSERT_UINT_WITHIN(2, records, count_of(reader, MAVLINK_MSG_ID_ATTITUDE));
    TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, reader.trials().back().end);
  }
}

// Everything that takes long is asked for before and while wheels turn: nothing is done until they stand, and all that was
// accepted then is.
TEST(no_tick_is_late_while_wheels_turn_whatever_a_host_asks) {
  for (const float time_s : {5.0f, 130.0f}) {
    SlowBench bench;
    bench.drive(3.0f);
    TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.closed().log);
    bench.longest_gap_while_driving_us = 0;
    bench.storage.slowness = 10.0;
    bench.run(20, bench.host.set_parameter("STAGGER_MS", 7) + bench.host.set_parameter("BATT_LOW_MS", 400) +
                      bench.host.set_parameter("TILT_MS", 300));
    bench.run(20, bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}) +
                      bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, time_s, 1, 9}));
    TEST_ASSERT_TRUE(bench.firmware.application().is_driving());
    const int saved = bench.storage.save_count;
    TEST_ASSERT_TRUE(saved < 3);
    bench.host.received.clear();
    while (bench.firmware.application().is_driving()) {
      bench.run(500, bench.host.set_parameter("STAGGER_MS", 50) + bench.host.request_log_list() +
                         bench.host.request_log_data(1) + bench.host.erase_logs() +
                         bench.host.command(MAV_CMD_PREFLIGHT_STORAGE, {2}));
      if (bench.firmware.application().is_driving()) TEST_ASSERT_EQUAL_INT(saved, bench.storage.save_count);
    }
    TEST_ASSERT_EQUAL_INT(0, bench.erased_while_driving);
    TEST_ASSERT_TRUE_MESSAGE(bench.longest_gap_while_driving_us <= 24000, "no tick is more than a page late");
    TEST_ASSERT_EQUAL_FLOAT_MESSAGE(7.0f, bench.host.parameters().front().param_value, "not set while wheels turn");
    TEST_ASSERT_TRUE(bench.host.said("refused: logs are not read or erased while wheels are driven"));
    TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.closed().log);
    bench.run(3000);
    TEST_ASSERT_EQUAL_FLOAT_MESSAGE(7.0f, bench.storage.values["STAGGER_MS"], "saved when wheels stand");
    TEST_ASSERT_EQUAL_FLOAT(300.0f, bench.storage.values["TILT_MS"]);
    TEST_ASSERT_EQUAL_UINT(2, bench.logs.logs.size());
    TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, read(bench.logs.logs[2]).trials().back().end);
  }
}

// A step of erasing stops both cores for up to 0.4 s.
TEST(wheels_do_not_start_before_flash_is_ready_for_the_next_log) {
  SlowBench bench;
  bench.drive(60.0f);
  bench.run(20, bench.host.set_parameter("STAGGER_MS", 7) +
                    bench.host.command(MAV_CMD_ACTUATOR_TEST, {0, 1, 0, 0, ACTUATOR_OUTPUT_FUNCTION_SERVO1}));
  TEST_ASSERT_EQUAL_INT(static_cast<int>(Refusal::kStoring), bench.host.acks().back().result_param2);
  bench.run(20, bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_OPEN, bench.told().log);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, bench.answer(MAV_CMD_PREFLIGHT_STORAGE, {2}));
  TEST_ASSERT_EQUAL_INT(static_cast<int>(Refusal::kStoring), bench.host.acks().back().result_param2);
  for (const float flags : {0.0f, 1.0f}) {
    TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED,
                           bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 5, flags, 9}));
    TEST_ASSERT_EQUAL_INT(static_cast<int>(Refusal::kStoring), bench.host.acks().back().result_param2);
  }
  bench.run(100, bench.host.stick(500));
  TEST_ASSERT_FALSE(bench.firmware.application().is_driving());
  TEST_ASSERT_EQUAL_STRING("refused: a log is being stored or erased", bench.host.texts().back().c_str());
  TEST_ASSERT_EQUAL_INT_MESSAGE(0, bench.storage.save_count, "nor is a parameter saved, as long as flash is not ready");
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.closed().log);
  bench.run(100);
  TEST_ASSERT_EQUAL_FLOAT(7.0f, bench.storage.values["STAGGER_MS"]);
  bench.run(20, bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  bench.longest_gap_while_driving_us = 0;
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 5, 0, 9}));
  bench.run(4900);
  TEST_ASSERT_TRUE(bench.firmware.application().is_driving());
  TEST_ASSERT_TRUE(bench.longest_gap_while_driving_us <= 20000);
}

// After a start nothing is known of the flash, which may have to be erased.
TEST(a_host_sees_when_the_flash_is_ready_after_the_start) {
  SlowBench bench(false);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_OPEN, bench.told().log);
  bench.run(20, bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  const auto start = [&bench] { return bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 5, 0, 9}); };
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, start());
  TEST_ASSERT_EQUAL_INT(static_cast<int>(Refusal::kStoring), bench.host.acks().back().result_param2);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_NONE, bench.closed().log);
  TEST_ASSERT_EQUAL_UINT32(0, bench.told().log_lost);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, start());
}

// As on a board without memory for the task that stores logs.
TEST(without_flash_for_logs_a_tethered_trial_starts) {
  SlowBench bench(false);
  bench.logs.fitted = false;
  bench.firmware.store_log();
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_NONE, bench.told().log);
  bench.run(20, bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 5, 0, 9}));
}

// They were set just before a tethered trial, which keeps no log. Saving takes up to 0.1 s.
TEST(no_parameter_is_saved_in_a_tethered_trial) {
  SlowBench bench;
  bench.run(20, bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  bench.run(5, bench.host.set_parameter("STAGGER_MS", 7) + bench.host.set_parameter("BATT_LOW_MS", 400) +
                   bench.host.set_parameter("TILT_MS", 300) +
                   bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 5, 0, 9}));
  TEST_ASSERT_TRUE(bench.firmware.application().is_driving());
  const int saved = bench.storage.save_count;
  TEST_ASSERT_TRUE(saved < 3);
  bench.run(4000);
  TEST_ASSERT_TRUE(bench.firmware.application().is_driving());
  TEST_ASSERT_EQUAL_INT(saved, bench.storage.save_count);
  bench.run(1200);
  TEST_ASSERT_EQUAL_INT(3, bench.storage.save_count);
}

// A loop that stands still for 0.8 s is reset.
TEST(logs_are_erased_one_in_a_tick) {
  SlowBench bench;
  for (int i = 0; i < 4; ++i) {
    bench.drive(1.0f);
    bench.closed();
  }
  TEST_ASSERT_EQUAL_UINT(4, bench.logs.logs.size());
  bench.run(5, bench.host.erase_logs());
  while (!bench.logs.logs.empty()) {
    const int writes = bench.logs.write_count;
    bench.board.clock.time_us += 1000;
    bench.firmware.poll();
    TEST_ASSERT_TRUE(bench.logs.write_count <= writes + 1);
  }
}

TEST(the_noisiest_trial_fits_in_a_log) {
  SlowBench bench;
  bench.noise = 1e3f;  // hardly a byte of a record is that of the one before
  bench.run(20, bench.host.set_parameter("TILT_MAX_RAD", 3.2f));
  bench.drive(130.0f);
  const mavlink_foldcar_trial_t told = bench.closed();
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, told.log);
  TEST_ASSERT_EQUAL_UINT32(0, told.log_lost);
}

TEST(a_flash_that_is_full_keeps_what_it_has_and_says_what_is_missing) {
  for (const std::size_t capacity : {std::size_t{0}, std::size_t{33000}}) {
    SlowBench bench;
    bench.logs.capacity = capacity;
    bench.drive(60.0f);
    const mavlink_foldcar_trial_t told = bench.closed();
    TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_INCOMPLETE, told.log);
    TEST_ASSERT_EQUAL_STRING(("the trial's log lacks " + std::to_string(told.log_lost) + " bytes").c_str(),
                             bench.host.texts().back().c_str());
    TEST_ASSERT_UINT_WITHIN(LogWriter::kSlice, capacity, bench.logs.logs[1].size() + LogWriter::kSlice);
    TEST_ASSERT_UINT_WITHIN(5 * 300, whole_size(60.0f), bench.logs.logs[1].size() + told.log_lost);
  }
}

// What a log that could not be closed has is not known.
TEST(a_flash_that_fails_only_when_the_log_is_closed_has_not_stored_it) {
  SlowBench bench;
  bench.logs.close_fails = true;
  bench.drive(3.0f);
  const mavlink_foldcar_trial_t told = bench.closed();
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_INCOMPLETE, told.log);
  TEST_ASSERT_EQUAL_UINT32(bench.logs.logs[1].size(), told.log_lost);
}

// Flash stands still until the end: what did not fit is missing from the middle. The records' sizes, and so what is left of
// the queue, differ with what the IMU measures.
TEST(a_log_that_lacks_records_still_tells_how_its_trial_ended) {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    SlowBench bench;
    bench.random.seed(seed);
    bench.flash_stops_both_cores = false;
    bench.logs.slowness = 1e4;
    bench.drive(8.0f);
    bench.logs.slowness = 0.0;
    bench.writer_free_us = 0;
    const mavlink_foldcar_trial_t told = bench.closed();
    TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_INCOMPLETE, told.log);
    const MavlinkHost reader = read(bench.logs.logs[1]);
    TEST_ASSERT_EQUAL_UINT32(MAVLINK_MSG_ID_FOLDCAR_TRIAL, reader.received.back().msgid);
    TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, reader.trials().back().end);
    TEST_ASSERT_EQUAL_UINT32(MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, reader.received[reader.received.size() - 2].msgid);
  }
}

// The reserve is kept of the queue, of 8 KiB, and of the log.
TEST(records_leave_the_reserve_free_for_those_of_the_end) {
  SimLogs logs;
  logs.fitted = true;
  LogWriter writer(logs);
  writer.work();
  const std::uint8_t record[100] = {};
  for (const bool is_stored : {false, true}) {
    TEST_ASSERT_TRUE(writer.begin());
    std::size_t size = 0;
    while (writer.put(record, 100, 333)) {
      size += 100;
      while (is_stored && writer.work()) {
      }
    }
    const std::size_t room = (is_stored ? kLogSize : LogWriter::kQueueSize) - size;
    TEST_ASSERT_TRUE(room >= 333 && room < 433);
    for (std::size_t taken = 0; taken < 333; ++taken) TEST_ASSERT_TRUE(writer.put(record, 1, 0));
    writer.finish();
    while (!writer.is_idle()) writer.work();
    TEST_ASSERT_TRUE(writer.status().state == LogState::kStored);
    TEST_ASSERT_EQUAL_UINT(size + 333, logs.size(logs.range().newest));
  }
}

// A log is not closed before all of it is in flash, and nothing else touches flash until then.
TEST(a_log_is_closed_when_all_is_stored) {
  SlowBench bench;
  bench.logs.slowness = 10.0;
  bench.flash_stops_both_cores = false;
  bench.drive(10.0f);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_OPEN, bench.told().log);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED,
                         bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 5, 1, 9}));
  TEST_ASSERT_EQUAL_INT(static_cast<int>(Refusal::kStoring), bench.host.acks().back().result_param2);
  bench.run(40, bench.host.request_log_list());
  TEST_ASSERT_EQUAL_UINT(0, count_of(bench.host, MAVLINK_MSG_ID_LOG_ENTRY));
  TEST_ASSERT_EQUAL_STRING("refused: a log is being stored or erased", bench.host.texts().back().c_str());
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, {1}));
  TEST_ASSERT_FALSE(bench.board.board.restart_is_requested);
  while (!bench.board.board.restart_is_requested) bench.run(20);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, read(bench.logs.logs[1]).trials().back().end);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.told().log);
}

// What a crash or a brown-out leaves of the trial that it ended: all but what waited in the queue.
TEST(a_log_survives_a_reset_while_wheels_turn) {
  SlowBench bench;
  bench.run(20, bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  bench.run(20, bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 60, 1, 8}));
  bench.run(10000);
  TEST_ASSERT_TRUE(bench.firmware.application().is_driving());
  MavlinkHost reader;
  reader.receive_log(bench.logs.logs[1]);
  TEST_ASSERT_UINT_WITHIN(2, 5 * 10, count_of(reader, MAVLINK_MSG_ID_ATTITUDE));
}

// They arrive at once. Between two polls there is a tick wherever one is due, and a tick saves one value at most.
TEST(sixty_settings_at_once_neither_keep_the_tick_waiting_nor_are_saved_sixty_times) {
  SlowBench bench;
  bench.run(2000);
  const std::uint32_t missed_before = bench.loop().missed_count;
  bench.host.received.clear();
  const std::uint64_t start_us = bench.board.clock.time_us;
  for (int i = 1; i <= 60; ++i) {
    bench.board.link.incoming += bench.host.set_parameter("STAGGER_MS", static_cast<float>(i));
  }
  for (unsigned polls = 1; bench.host.parameters().size() < 60 || polls < 40; ++polls) {
    const int saved_before = bench.storage.save_count;
    bench.board.clock.time_us += 1000;
    bench.firmware.poll();
    TEST_ASSERT_TRUE(bench.storage.save_count - saved_before <= 1);
    bench.host.receive(bench.board.link.outgoing);
    bench.board.link.outgoing.clear();
    TEST_ASSERT_TRUE(bench.host.parameters().size() <= 4 * polls);
  }
  TEST_ASSERT_TRUE_MESSAGE(bench.board.clock.time_us - start_us < 100000, "sixty settings are handled within five ticks");
  TEST_ASSERT_TRUE(bench.storage.save_count <= 2);
  TEST_ASSERT_EQUAL_UINT32(missed_before, bench.loop().missed_count);
  TEST_ASSERT_EQUAL_FLOAT(60.0f, bench.storage.values["STAGGER_MS"]);
  TEST_ASSERT_EQUAL_FLOAT(60.0f, bench.host.parameters().back().param_value);
}

TEST(every_value_that_was_set_is_saved_before_a_restart) {
  SlowBench bench;
  std::string settings;
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
    settings += bench.host.set_parameter(parameter_info(channel_parameter(channel, ChannelParameter::kGainUs)).name, 7.0f);
  }
  bench.run(20, settings + bench.host.command(MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, {1}));
  TEST_ASSERT_TRUE(bench.storage.values.size() < kChannelCount);
  while (!bench.board.board.restart_is_requested) bench.run(20);
  TEST_ASSERT_EQUAL_UINT(kChannelCount, bench.storage.values.size());
}

TEST(two_threads_record_and_store_a_log) {
  TEST_ASSERT_EQUAL_STRING("", record_and_store_in_two_threads(4, 1).c_str());
}
