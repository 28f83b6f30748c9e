// The supervisor, which alone enables pulses.
#include <unity.h>

#include "supervisor_bench.h"

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  foldcar::run_state_table_tests();
  foldcar::run_request_tests();
  foldcar::run_time_tests();
  foldcar::run_fault_tests();
  return UNITY_END();
}
