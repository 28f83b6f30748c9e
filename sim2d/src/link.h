// `carsim link`: a car with its whole firmware on a port, in real time or faster (docs/carsim.md).
#pragma once

#include <string>
#include <vector>

namespace foldcar {

// words: the arguments behind "link". Returns 0 after SIGTERM, Ctrl-C or the end of a replay, 2 if a record cannot be
// written. Throws LinkUsageError (wrong options), InputError (wrong files) or std::runtime_error.
int run_link(const std::vector<std::string>& words);

}  // namespace foldcar
