// What waited while the car's loop stood still or the board started sets nothing in motion.
#include "../../suite.h"

#include "link_bench.h"

using namespace foldcar;

// The host's bytes arrive while the loop stands still for time_ms; then it comes round again.
static void stand_still(LinkBench& bench, std::uint64_t time_ms, const std::string& bytes) {
  bench.board.link.incoming += bytes;
  bench.board.clock.time_us += 1000 * time_ms;
  bench.run(20);
}

// A write to flash, of up to 250 ms, makes nothing late.
TEST(a_start_that_waited_is_refused_and_one_that_did_not_is_executed) {
  LinkBench bench;
  const std::string start = bench.host.heartbeat() + bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  stand_still(bench, 250, start);
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
  bench.answer(MAV_CMD_FOLDCAR_STOP_TRIAL, {});
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  stand_still(bench, 600, start);
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_TEMPORARILY_REJECTED, bench.host.acks().back().result);
  TEST_ASSERT_TRUE(bench.last_refusal() == Refusal::kLate);
  TEST_ASSERT_EQUAL_STRING("refused: it waited while the car stood still", bench.last_text().c_str());
  TEST_ASSERT_TRUE(bench.state() == State::kArmed);
  // Its repetition is a new command.
  TEST_ASSERT_EQUAL_UINT(MAV_RESULT_ACCEPTED, bench.answer(MAV_CMD_FOLDCAR_START_TRIAL, kStart, 1).result);
  TEST_ASSERT_TRUE(bench.state() == State::kRunning);
}

TEST(a_late_stick_and_late_signs_of_life_count_for_nothing) {
  LinkBench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  std::string bytes = bench.host.heartbeat() + bench.host.heartbeat();
  for (int i = 0; i < 200; ++i) bytes += bench.host.stick(500);
  stand_still(bench, 5100, bytes);
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
  TEST_ASSERT_TRUE(bench.last_us() == kOff);
  bench.run(20, bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  bench.run(2100);
  bench.run(20, bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, kStart));
  TEST_ASSERT_TRUE(bench.last_refusal() == Refusal::kUnknownHost);
}

TEST(a_late_stop_and_a_late_disarm_are_executed) {
  LinkBench bench;
  bench.start(kStartUntethered);
  stand_still(bench, 600, bench.host.command(MAV_CMD_FOLDCAR_STOP_TRIAL, {}));
  TEST_ASSERT_TRUE(bench.state() == State::kFinished);
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  stand_still(bench, 600, bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {0}));
  TEST_ASSERT_TRUE(bench.state() == State::kDisarmed);
}

// A stopped simulation does not know by its own clock that it was stopped.
TEST(a_caller_that_knows_of_a_pause_says_so) {
  LinkBench bench;
  bench.answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  bench.board.link.incoming = bench.host.heartbeat() + bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  bench.firmware.stood_still();
  bench.run(20);
  TEST_ASSERT_TRUE(bench.last_refusal() == Refusal::kLate);
  TEST_ASSERT_TRUE(bench.state() == State::kArmed);
}

TEST(what_arrived_while_the_board_started_is_forgotten) {
  RecordingHal board;
  board.link.room = 100000;
  MavlinkHost host;
  board.link.incoming = host.heartbeat() + host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1});
  Firmware firmware{board.hal(), kBuild};
  firmware.begin({});
  firmware.poll();
  TEST_ASSERT_TRUE(firmware.application().status().state == State::kDisarmed);
}
