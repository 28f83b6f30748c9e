// The application over a recording HAL, which keeps the HAL's contract.
#include "../suite.h"

#include "../hal_contract.h"
#include "application_bench.h"

using namespace foldcar;

TEST(the_recording_hal_keeps_the_contract) {
  for (const bool with_imu : {false, true}) {
    RecordingHal board;
    board.imu.fitted = with_imu;
    check_hal_contract(board.hal(), [&board] { board.clock.time_us += 10; });
  }
}
