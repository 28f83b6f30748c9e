// `carsim link`: a car with its whole firmware on a port, in real time or faster. docs/carsim.md describes it.
#pragma once

#include <string>
#include <vector>

namespace foldcar {

// words: what stands behind "link". 0 after SIGTERM or Ctrl-C or at the end of a replay; throws InputError,
// LinkUsageError (wrong options) or std::runtime_error.
int run_link(const std::vector<std::string>& words);

}  // namespace foldcar
