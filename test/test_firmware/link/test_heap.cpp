// The firmware takes no memory from the heap after its set-up.
#include "../../suite.h"

#include <cstdlib>
#include <new>
#include <string>

#include "link_bench.h"

namespace {
std::size_t allocation_count = 0;
}

// Counts allocations and otherwise does what the standard library's does. Not inlined, because the compiler would warn of a
// mismatch of malloc and delete.
__attribute__((noinline)) void* operator new(std::size_t size) {
  ++allocation_count;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
__attribute__((noinline)) void operator delete(void* memory) noexcept { std::free(memory); }
__attribute__((noinline)) void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

using namespace foldcar;

TEST(after_set_up_nothing_is_taken_from_the_heap) {
  LinkBench bench;
  bench.board.fit_imu();
  bench.board.servos.writes.reserve(100000);
  bench.board.link.outgoing.reserve(1000000);
  bench.board.link.incoming.reserve(10000);
  bench.board.storage.values["TRACK_M"] = 0.1f;
  const std::string requests = bench.host.heartbeat() + bench.host.request_list() +
                               bench.host.set_parameter("TRACK_M", 0.2f) + bench.host.set_parameter("TRACK_M", -1.0f) +
                               bench.host.command(MAV_CMD_REQUEST_MESSAGE, {MAVLINK_MSG_ID_FOLDCAR_DESIGN}) +
                               bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}) +
                               bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, kStart);
  const std::string heartbeat = bench.host.heartbeat();
  const std::size_t before = allocation_count;
  bench.board.link.incoming += requests;
  for (int poll = 0; poll < 5500; ++poll) {
    if (poll % 50 == 0) bench.board.link.incoming += heartbeat;
    bench.board.clock.time_us += 4000;
    bench.firmware.poll();
  }
  TEST_ASSERT_EQUAL_UINT(before, allocation_count);
  TEST_ASSERT_TRUE(bench.firmware.application().trial_end() == TrialEnd::kTimeLimit);
  TEST_ASSERT_EQUAL_FLOAT(0.2f, bench.board.storage.values["TRACK_M"]);
}
