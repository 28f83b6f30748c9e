// The application over a recording HAL, which keeps the HAL's contract.
#include <unity.h>

#include "../hal_contract.h"
#include "application_bench.h"

using namespace foldcar;

void setUp() {}
void tearDown() {}

void the_recording_hal_keeps_the_contract() {
  for (const bool with_imu : {false, true}) {
    RecordingHal board;
    board.imu.fitted = with_imu;
    check_hal_contract(board.hal(), [&board] { board.clock.time_us += 10; });
  }
}

int main() {
  UNITY_BEGIN();
  RUN_TEST(the_recording_hal_keeps_the_contract);
  run_start_up_tests();
  run_tick_tests();
  run_fault_tests();
  run_by_hand_tests();
  return UNITY_END();
}
