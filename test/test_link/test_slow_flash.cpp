// Flash that is slow, full or busy: no tick waits for it, and what is lost is told.
#include <unity.h>

#include <string>

#include "../log_threads.h"
#include "../slow_flash.h"
#include "link_bench.h"

namespace foldcar {
namespace {

struct SlowBench {
  RecordingHal board;
  SlowLogs logs{board.clock};
  SlowStorage storage{board.clock};
  Firmware firmware{Hal{board.clock, board.servos, board.battery, board.link, storage, board.imu, logs, board.board},
                    kBuild};
  MavlinkHost host;
  bool erasing_stops_both_cores = false;  // as on the ESP32; else the task that writes is alone in waiting
  std::uint64_t writer_free_us = 0;       // when the task that stores the log has time again
  int writes_while_driving = 0;

  SlowBench() {
    board.link.room = 100000;
    board.imu.fitted = true;
    board.imu.now.acceleration_m_s2 = {0.0f, 0.0f, 9.81f};
    firmware.begin({});
  }
  // As Bench::run, every millisecond and with a sign of life five times a second; the log is stored by another task.
  void run(std::uint64_t time_ms, const std::string& bytes = "") {
    board.link.incoming += bytes;
    const std::uint64_t end_us = board.clock.time_us + 1000 * time_ms;
    for (std::uint64_t polls = 0; board.clock.time_us < end_us; ++polls) {
      if (polls % 200 == 0) board.link.incoming += host.heartbeat();
      board.clock.time_us += 1000;
      firmware.poll();
      if (board.clock.time_us >= writer_free_us) store_log();
    }
    host.receive(board.link.outgoing);
    board.link.outgoing.clear();
    board.servos.writes.clear();
  }
  void store_log() {
    const std::uint64_t before_us = board.clock.time_us;
    const int writes = logs.write_count;
    firmware.store_log();
    if (firmware.application().is_driving()) writes_while_driving += logs.write_count - writes;
    writer_free_us = board.clock.time_us;
    if (!erasing_stops_both_cores) board.clock.time_us = before_us;
  }
  // An untethered trial of that length (s), driven to its end.
  void drive(float time_s) {
    run(20, host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
    run(20, host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, time_s, 1, 8}));
    TEST_ASSERT_TRUE(firmware.application().is_driving());
    while (firmware.application().is_driving()) run(20);
    TEST_ASSERT_TRUE(firmware.application().trial_end() == TrialEnd::kTimeLimit);
  }
  MAV_RESULT answer(std::uint16_t command, const std::vector<float>& values) {
    run(20, host.command(command, values));
    return static_cast<MAV_RESULT>(host.acks().back().result);
  }
  mavlink_foldcar_trial_t told() {
    run(200);
    return host.trials().back();
  }
  mavlink_foldcar_loop_t loop() {
    run(1100);
    return host.all<mavlink_foldcar_loop_t>(MAVLINK_MSG_ID_FOLDCAR_LOOP, mavlink_msg_foldcar_loop_decode).back();
  }
};

// The packets of a log, which must be whole.
MavlinkHost read(const std::string& log) {
  MavlinkHost reader;
  for (std::size_t at = 0; at < log.size();) {
    TEST_ASSERT_TRUE(at + 20 <= log.size());
    const std::size_t size = 12 + static_cast<std::uint8_t>(log[at + 9]);
    reader.receive(log.substr(at + 8, size));
    at += 8 + size;
  }
  TEST_ASSERT_EQUAL_INT(0, reader.bad_count);
  return reader;
}

// The size (bytes) of the log of such a trial with a flash that takes no time. Records that tell of a loss are up to 5 bytes
// longer.
std::size_t whole_size(float time_s) {
  SlowBench bench;
  bench.logs.slowness = 0.0;
  bench.drive(time_s);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.told().log);
  return bench.logs.logs[1].size();
}

// A tick takes no time on this clock, unless it waits for flash. 60 s of records are more than the log keeps in RAM.
void no_tick_waits_for_the_log() {
  SlowBench bench;
  bench.drive(60.0f);
  TEST_ASSERT_TRUE(bench.writes_while_driving >= 2);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.told().log);
  const mavlink_foldcar_loop_t loop = bench.loop();
  TEST_ASSERT_EQUAL_UINT32(0, loop.worst_us);
  TEST_ASSERT_EQUAL_UINT32(0, loop.missed_count);
  const MavlinkHost reader = read(bench.logs.logs[1]);
  TEST_ASSERT_UINT_WITHIN(2, 5 * 60, count_of(reader, MAVLINK_MSG_ID_SERVO_OUTPUT_RAW));
  TEST_ASSERT_UINT_WITHIN(2, 5 * 60, count_of(reader, MAVLINK_MSG_ID_ATTITUDE));
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, reader.trials().back().end);
}

void a_trial_of_25_s_leaves_flash_alone_until_the_wheels_stand() {
  SlowBench bench;
  bench.erasing_stops_both_cores = true;
  bench.drive(25.0f);
  TEST_ASSERT_EQUAL_INT(0, bench.writes_while_driving);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.told().log);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, read(bench.logs.logs[1]).trials().back().end);
}

// At most one append in 27 s, and before the first the log's creation.
void a_long_trial_is_held_up_rarely_where_erasing_stops_both_cores() {
  SlowBench bench;
  bench.erasing_stops_both_cores = true;
  bench.drive(180.0f);
  TEST_ASSERT_TRUE(bench.writes_while_driving >= 3 && bench.writes_while_driving <= 180 / 27 + 1);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.told().log);
}

void what_comes_faster_than_flash_takes_it_is_counted_and_told() {
  SlowBench bench;
  bench.logs.slowness = 600.0;  // a minute for each write
  bench.drive(120.0f);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_OPEN, bench.told().log);
  while (bench.told().log == FOLDCAR_LOG_OPEN) {
  }
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_INCOMPLETE, bench.told().log);
  const std::uint32_t lost = bench.told().log_lost;
  TEST_ASSERT_EQUAL_STRING(("the trial's log lacks " + std::to_string(lost) + " bytes").c_str(),
                           bench.host.texts().back().c_str());
  const MavlinkHost reader = read(bench.logs.logs[1]);
  TEST_ASSERT_EQUAL_UINT32_MESSAGE(lost, reader.trials().back().log_lost, "the log's end says it too");
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, reader.trials().back().end);
  TEST_ASSERT_UINT_WITHIN(5 * 600, whole_size(120.0f), bench.logs.logs[1].size() + lost);
  TEST_ASSERT_TRUE(lost > 10000);
  TEST_ASSERT_EQUAL_UINT32(0, bench.loop().worst_us);
}

void a_flash_that_is_full_keeps_what_it_has_and_says_what_is_missing() {
  for (const std::size_t capacity : {std::size_t{0}, LogWriter::kBlock + 1000}) {
    SlowBench bench;
    bench.logs.capacity = capacity;
    bench.drive(60.0f);
    const mavlink_foldcar_trial_t told = bench.told();
    TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_INCOMPLETE, told.log);
    TEST_ASSERT_EQUAL_UINT(capacity == 0 ? 0 : LogWriter::kBlock, bench.logs.logs[1].size());
    TEST_ASSERT_UINT_WITHIN(5 * 300, whole_size(60.0f), bench.logs.logs[1].size() + told.log_lost);
    TEST_ASSERT_EQUAL_UINT32(0, bench.loop().worst_us);
  }
}

// A log is not closed before all of it is in flash, and nothing else touches flash until then.
void a_log_is_closed_when_all_is_stored() {
  SlowBench bench;
  bench.logs.slowness = 10.0;
  bench.drive(10.0f);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_OPEN, bench.told().log);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED,
                         bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 5, 1, 9}));
  TEST_ASSERT_EQUAL_INT(static_cast<int>(Refusal::kNoLog), bench.host.acks().back().result_param2);
  mavlink_log_request_list_t list{};
  list.target_system = list.target_component = 1;
  list.end = 0xFFFF;
  bench.run(40, bench.host.pack(mavlink_msg_log_request_list_encode_status, list));
  TEST_ASSERT_EQUAL_UINT(0, count_of(bench.host, MAVLINK_MSG_ID_LOG_ENTRY));
  TEST_ASSERT_EQUAL_STRING("refused: the log of the last trial is being stored", bench.host.texts().back().c_str());
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, {1}));
  TEST_ASSERT_FALSE(bench.board.board.restart_is_requested);
  while (!bench.board.board.restart_is_requested) bench.run(20);
  TEST_ASSERT_EQUAL_INT_MESSAGE(3, bench.logs.write_count, "created, stored, closed");
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, read(bench.logs.logs[1]).trials().back().end);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.told().log);
}

void without_storage_for_logs_an_untethered_trial_is_refused() {
  SlowBench bench;
  bench.logs.fitted = false;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED,
                         bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 5, 1, 9}));
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 5, 0, 9}));
}

// They arrive at once. Between two polls there is a tick wherever one is due, and a tick saves one value at most.
void sixty_settings_at_once_neither_keep_the_tick_waiting_nor_are_saved_sixty_times() {
  SlowBench bench;
  bench.run(2000);
  const std::uint32_t ticks_before = bench.loop().tick_count;
  bench.host.received.clear();
  const std::uint64_t start_us = bench.board.clock.time_us;
  for (int i = 1; i <= 60; ++i) {
    bench.board.link.incoming += bench.host.set_parameter("STAGGER_MS", static_cast<float>(i));
  }
  for (int polls = 0; bench.host.parameters().size() < 60 || polls < 40; ++polls) {
    const int saved_before = bench.storage.save_count;
    bench.board.clock.time_us += 1000;
    bench.firmware.poll();
    TEST_ASSERT_TRUE(bench.storage.save_count - saved_before <= 1);
    bench.host.receive(bench.board.link.outgoing);
    TEST_ASSERT_TRUE(bench.host.parameters().size() <= 4u * static_cast<unsigned>(polls + 1));
    bench.board.link.outgoing.clear();
  }
  const std::uint64_t elapsed_ms = (bench.board.clock.time_us - start_us) / 1000;
  TEST_ASSERT_TRUE_MESSAGE(elapsed_ms < 100, "sixty settings are handled within five ticks");
  TEST_ASSERT_TRUE(bench.storage.save_count <= 2);
  TEST_ASSERT_EQUAL_FLOAT(60.0f, bench.storage.values["STAGGER_MS"]);
  TEST_ASSERT_EQUAL_FLOAT(60.0f, bench.host.parameters().back().param_value);
  bench.run(900);
  TEST_ASSERT_UINT_WITHIN(2, (900 + elapsed_ms) / 20 + 55, bench.loop().tick_count - ticks_before);
}

void every_value_that_was_set_is_saved_before_a_restart() {
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

void two_threads_record_and_store_a_log() {
  TEST_ASSERT_EQUAL_STRING("", record_and_store_in_two_threads(4, 1).c_str());
}

}  // namespace

void run_slow_flash_tests() {
  UnitySetTestFile(__FILE__);
  RUN_TEST(no_tick_waits_for_the_log);
  RUN_TEST(a_trial_of_25_s_leaves_flash_alone_until_the_wheels_stand);
  RUN_TEST(a_long_trial_is_held_up_rarely_where_erasing_stops_both_cores);
  RUN_TEST(what_comes_faster_than_flash_takes_it_is_counted_and_told);
  RUN_TEST(a_flash_that_is_full_keeps_what_it_has_and_says_what_is_missing);
  RUN_TEST(a_log_is_closed_when_all_is_stored);
  RUN_TEST(without_storage_for_logs_an_untethered_trial_is_refused);
  RUN_TEST(two_threads_record_and_store_a_log);
  RUN_TEST(sixty_settings_at_once_neither_keep_the_tick_waiting_nor_are_saved_sixty_times);
  RUN_TEST(every_value_that_was_set_is_saved_before_a_restart);
}

}  // namespace foldcar
