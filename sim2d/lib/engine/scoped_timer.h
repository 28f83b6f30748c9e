// Wall time of a simulation by its parts, for the benchmark.
#pragma once

#include <chrono>

namespace foldcar {

// Wall time in seconds. Filled only where a caller hands one over.
struct Stopwatch {
  double physics_s = 0;   // equations of motion and contact impulses; in the side view contacts, too
  double terrain_s = 0;   // finding contacts with the ground
  double firmware_s = 0;  // the application's ticks
};

// Adds its own lifetime (s), times weight, to *total_s when it goes out of scope; does nothing if total_s is null.
class ScopedTimer {
 public:
  explicit ScopedTimer(double* total_s, double weight = 1) : total_s_(total_s), weight_(weight) {
    if (total_s_ != nullptr) start_ = std::chrono::steady_clock::now();
  }
  ~ScopedTimer() {
    if (total_s_ == nullptr) return;
    *total_s_ += weight_ * std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  ScopedTimer(const ScopedTimer&) = delete;
  ScopedTimer& operator=(const ScopedTimer&) = delete;

 private:
  double* total_s_;
  double weight_;
  std::chrono::steady_clock::time_point start_;
};

// Of what happens at every step, one in this many is timed, with this weight: reading the clock at every step would
// take several percent of the time that is measured.
constexpr unsigned kTimedStepInterval = 16;

}  // namespace foldcar
