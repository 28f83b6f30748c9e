// `carsim batch`: bodies, scenes and runs in, results out, as JSON Lines in the order of the input.
#pragma once

namespace foldcar {

// Serves standard input until its end; with timing, says on standard error where the time went. 0 if every line was
// usable, else 2. std::runtime_error if the output cannot be written.
int run_batch(bool timing);

}  // namespace foldcar
