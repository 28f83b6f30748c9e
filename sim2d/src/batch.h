// `carsim batch`: JSON Lines in, JSON Lines out, in the order of the input, with several worker processes.
#pragma once

namespace foldcar {

struct BatchOptions {
  int jobs = 1;
  bool timing = false;
};

// Serves input until its end. 0 if every line was usable, else 2.
int run_batch(const BatchOptions& options, int input, int output);

}  // namespace foldcar
