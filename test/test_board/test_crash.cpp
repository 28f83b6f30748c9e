// What is kept of a crash over the reset, and the guard that restarts a board whose loop() stands still.
#include "../suite.h"

#include <esp_private/panic_internal.h>
#include <esp_system.h>
#include <freertos/xtensa_context.h>

#include <array>

#include "../../firmware/lib/feather_hal/crash_memory.h"
#include "../../firmware/lib/feather_hal/loop_guard.h"
#include "feather_bench.h"

using namespace foldcar;

extern "C" void __wrap_esp_panic_handler(panic_info_t* info);

constexpr std::uint32_t kStack = 0x3FFB0100;

// A load from address 4, three calls deep. Return addresses have the window's size in their two highest bits.
static const XtExcFrame kBadLoad{1, 0x400D1234, 0, static_cast<long>(0x800D2345u), kStack, 28, 4};
static const std::deque<std::uint32_t> kCallers = {0x800D3456, 0};
static const std::uint32_t kBadLoadAddresses[CrashReport::kMaxAddresses] = {0x400D1234, 0x400D2342, 0x400D3453};

static void crash(const XtExcFrame& frame, bool pseudo_cause = false) {
  fake_esp32.return_addresses = kCallers;
  panic_info_t info{&frame, pseudo_cause};
  __wrap_esp_panic_handler(&info);
}

// The board after a reset for that reason: its report, or none.
static const CrashReport* report_after(Esp32Board& board, esp_reset_reason_t reason) {
  fake_esp32.reset_reason = reason;
  board.begin();
  return board.crash_report();
}

static void forget_report() {
  CrashReport report;
  take_crash(report);
}

TEST(a_crash_is_kept_over_the_reset_with_its_cause_and_its_callers) {
  FeatherBench bench;
  forget_report();
  crash(kBadLoad);
  Esp32Board board;
  const CrashReport* report = report_after(board, ESP_RST_PANIC);
  TEST_ASSERT_NOT_NULL(report);
  TEST_ASSERT_EQUAL_UINT8(28, report->cause);
  TEST_ASSERT_EQUAL_HEX32(4, report->data_address);
  TEST_ASSERT_EQUAL_HEX32_ARRAY(kBadLoadAddresses, report->addresses, CrashReport::kMaxAddresses);
  Esp32Board after_next_reset;
  TEST_ASSERT_NULL_MESSAGE(report_after(after_next_reset, ESP_RST_PANIC), "a crash is told after one reset");
}

TEST(what_the_sdk_ends_has_no_exception) {
  for (const bool by_watchdog : {false, true}) {
    FeatherBench bench;
    forget_report();
    g_panic_abort = !by_watchdog;
    crash(kBadLoad, by_watchdog);
    g_panic_abort = false;
    Esp32Board board;
    const CrashReport* report = report_after(board, by_watchdog ? ESP_RST_INT_WDT : ESP_RST_PANIC);
    TEST_ASSERT_NOT_NULL(report);
    TEST_ASSERT_EQUAL_UINT8(CrashReport::kNoException, report->cause);
    TEST_ASSERT_EQUAL_HEX32(0, report->data_address);
    TEST_ASSERT_EQUAL_HEX32(0x400D1234, report->addresses[0]);
  }
}

TEST(a_report_counts_after_a_crash_or_a_watchdog_only) {
  const std::pair<esp_reset_reason_t, bool> kReasons[] = {
      {ESP_RST_UNKNOWN, false}, {ESP_RST_POWERON, false}, {ESP_RST_EXT, false},   {ESP_RST_SW, false},
      {ESP_RST_PANIC, true},    {ESP_RST_INT_WDT, true},  {ESP_RST_TASK_WDT, true}, {ESP_RST_WDT, true},
      {ESP_RST_DEEPSLEEP, false}, {ESP_RST_BROWNOUT, false}};
  for (const auto& [reason, counts] : kReasons) {
    FeatherBench bench;
    forget_report();
    crash(kBadLoad);
    Esp32Board board;
    TEST_ASSERT_EQUAL_INT(counts, report_after(board, reason) != nullptr);
  }
}

// The memory is as the power-on left it.
TEST(without_a_report_a_crash_has_none) {
  FeatherBench bench;
  forget_report();
  Esp32Board board;
  TEST_ASSERT_NULL(report_after(board, ESP_RST_PANIC));
}

TEST(a_destroyed_stack_ends_the_walk) {
  FeatherBench bench;
  forget_report();
  XtExcFrame frame = kBadLoad;
  frame.a1 = 0x12345670;
  crash(frame);
  Esp32Board board;
  const std::uint32_t expected[CrashReport::kMaxAddresses] = {0x400D1234};
  TEST_ASSERT_EQUAL_HEX32_ARRAY(expected, report_after(board, ESP_RST_PANIC)->addresses, CrashReport::kMaxAddresses);
}

TEST(a_deep_stack_fills_the_report_and_no_more) {
  FeatherBench bench;
  forget_report();
  fake_esp32.return_addresses.assign(100, 0x800D4567);
  CrashReport report;
  trace_callers({0x400D1234, kStack, 0x800D2345}, report);
  for (std::size_t i = 2; i < CrashReport::kMaxAddresses; ++i) TEST_ASSERT_EQUAL_HEX32(0x400D4564, report.addresses[i]);
}

static PulsesUs one_pulse() {
  PulsesUs pulses_us{};
  pulses_us[0] = 1500.0f;
  return pulses_us;
}

TEST(a_loop_that_stands_still_is_ended_sooner_while_wheels_are_driven) {
  BegunBench bench;
  bench.hal.board.start_watchdog();
  fake_esp32.loop_stack_top = &kBadLoad;
  TEST_ASSERT_EQUAL_UINT32_MESSAGE(0, ms_until_restart(), "setup() may take its time");
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(PulsesUs{}));
  TEST_ASSERT_EQUAL_UINT32(LoopGuard::kStandingMs, ms_until_restart());
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(one_pulse()));
  TEST_ASSERT_EQUAL_UINT32(LoopGuard::kDrivingMs, ms_until_restart());
  for (int round = 0; round < 20; ++round) {
    TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(one_pulse()));
    pass_fake_time(1000 * (LoopGuard::kDrivingMs - 1));
  }
  // As after a trial: the tick that ends it may save a parameter, which takes longer.
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(PulsesUs{}));
  pass_fake_time(1000 * (LoopGuard::kStandingMs - 1));
  TEST_ASSERT_EQUAL_INT(ESP_RST_TASK_WDT, fake_esp32.reset_hint);
  forget_report();
}

// Whether the bus answers or not: loop() goes on.
TEST(a_bus_that_fails_is_no_loop_that_stands_still) {
  BegunBench bench;
  bench.hal.board.start_watchdog();
  fake_esp32.i2c.bus_hangs = true;
  for (int tick = 0; tick < 100; ++tick) {
    TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(tick % 2 == 0 ? one_pulse() : PulsesUs{}));
    pass_fake_time(20000);
  }
  TEST_ASSERT_EQUAL_INT(0, fake_esp32.reset_hint);
}

// What the SDK's handler is given is the guard's own end.
TEST(the_guard_keeps_where_loop_stands_and_not_where_it_is_ended) {
  const XtSolFrame asleep{0, static_cast<long>(0x800D1237u), 0, 0, static_cast<long>(0x800D2345u), kStack};
  for (const void* top : std::array<const void*, 2>{&kBadLoad, &asleep}) {
    BegunBench bench;
    forget_report();
    bench.hal.board.start_watchdog();
    TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(one_pulse()));
    fake_esp32.loop_stack_top = top;
    fake_esp32.return_addresses = kCallers;
    TEST_ASSERT_TRUE(ms_until_restart() > 0);
    g_panic_abort = true;
    crash({1, 0x40088788, 0, 0, kStack, 0, 0});
    g_panic_abort = false;
    Esp32Board restarted;
    const CrashReport* report = report_after(restarted, ESP_RST_TASK_WDT);
    TEST_ASSERT_EQUAL_UINT8(CrashReport::kNoException, report->cause);
    TEST_ASSERT_EQUAL_HEX32_ARRAY(kBadLoadAddresses, report->addresses, CrashReport::kMaxAddresses);
  }
}
