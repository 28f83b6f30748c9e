// A serial line that damages or loses bytes at random. Its random numbers are seeded, so that a run is repeatable.
#pragma once

#include <cstdint>
#include <vector>

namespace foldcar {

// One direction of the cable.
class LineNoise {
 public:
  enum class Kind { kCorrupt, kDrop };

  explicit LineNoise(std::uint64_t seed) : state_(seed) {}

  // Damages or drops each byte with this probability (0 to 1) until the time until_us (µs).
  void set(Kind kind, double probability, std::uint64_t until_us);

  // Returns the bytes that arrive if these bytes are sent at now_us (µs).
  std::vector<std::uint8_t> pass(const std::vector<std::uint8_t>& bytes, std::uint64_t now_us);

 private:
  std::uint64_t next();

  std::uint64_t state_;
  Kind kind_ = Kind::kCorrupt;
  double probability_ = 0;
  std::uint64_t until_us_ = 0;
};

}  // namespace foldcar
