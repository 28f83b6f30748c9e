// The log's two threads under ThreadSanitizer: `make races`.
#include <cstdio>

#include "../log_threads.h"

int main() {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const std::string problem = foldcar::record_and_store_in_two_threads(4, seed);
    if (!problem.empty()) return std::printf("seed %u: %s\n", seed, problem.c_str()), 1;
  }
  std::printf("20 logs recorded by one thread and stored by another: no race, no byte wrong\n");
  return 0;
}
