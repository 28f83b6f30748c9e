// Feeds the link with random and damaged bytes: fuzz_link BYTES SEED. `make fuzz` builds it with the address and
// undefined-behaviour sanitizers.
#include <cstdio>
#include <cstdlib>

#include "../link_fuzz.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: fuzz_link BYTES SEED\n", stderr);
    return 2;
  }
  foldcar::LinkFuzz fuzz(std::strtoull(argv[2], nullptr, 10));
  const bool stood_still = fuzz.run(std::strtoull(argv[1], nullptr, 10));
  std::printf("%llu bytes, %llu answers, %s\n", static_cast<unsigned long long>(fuzz.fed()),
              static_cast<unsigned long long>(fuzz.accepted_count()), stood_still ? "no motion" : "MOTION");
  return stood_still ? 0 : 1;
}
