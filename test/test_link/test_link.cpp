// The car's end of the MAVLink connection, over a recording HAL.
#include <unity.h>

#include "link_bench.h"

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  foldcar::run_telemetry_tests();
  foldcar::run_parameter_tests();
  foldcar::run_command_tests();
  foldcar::run_holder_tests();
  foldcar::run_late_input_tests();
  foldcar::run_link_loss_tests();
  foldcar::run_log_tests();
  foldcar::run_slow_flash_tests();
  foldcar::run_packet_parser_tests();
  foldcar::run_heap_tests();
  return UNITY_END();
}
