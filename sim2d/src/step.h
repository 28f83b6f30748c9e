// `carsim step`: one trial at a time over standard input and output, advanced by the caller.
#pragma once

namespace foldcar {

// Serves standard input until its end. 0 if every line was usable, else 2. std::runtime_error if the output cannot be
// written.
int run_step();

}  // namespace foldcar
