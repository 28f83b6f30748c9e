// Where a batch's time goes, for the benchmark: filled only when somebody asks for it.
#pragma once

#include <chrono>

namespace foldcar {

struct Stopwatch {
  double physics_s = 0;   // b2World::Step
  double terrain_s = 0;   // cutting and replacing outlines
  double firmware_s = 0;  // the application's ticks
};

// Adds its own lifetime, times weight, to total, if there is one.
class Lap {
 public:
  explicit Lap(double* total_s, double weight = 1) : total_s_(total_s), weight_(weight) {
    if (total_s_ != nullptr) start_ = std::chrono::steady_clock::now();
  }
  ~Lap() {
    if (total_s_ == nullptr) return;
    *total_s_ += weight_ * std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  Lap(const Lap&) = delete;
  Lap& operator=(const Lap&) = delete;

 private:
  double* total_s_;
  double weight_;
  std::chrono::steady_clock::time_point start_;
};

// What happens at every step is timed once in this many and counted as many times: reading the clock at every
// step would cost several percent of the time that is to be measured.
constexpr unsigned kSampledLaps = 16;

}  // namespace foldcar
