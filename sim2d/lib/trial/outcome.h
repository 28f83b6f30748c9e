// How a trial ends.
#pragma once

namespace foldcar {

// kTerminated: the scene's program, or the caller of `carsim step`, ended the trial, and it has not passed.
enum class Outcome { kPassed, kTipped, kStuck, kOffCourse, kTimeout, kFault, kTerminated };
const char* text(Outcome outcome);

}  // namespace foldcar
