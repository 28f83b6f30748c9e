// A bad cable: bytes that arrive wrong or not at all. Seeded, so that a run repeats.
#pragma once

#include <cstdint>
#include <vector>

namespace foldcar {

// One direction of the cable.
class LineNoise {
 public:
  enum class Kind { kCorrupt, kDrop };

  explicit LineNoise(std::uint64_t seed) : state_(seed) {}

  // From now on and until then that share of the bytes suffers.
  void set(Kind kind, double share, std::uint64_t until_us);

  // The bytes that arrive.
  std::vector<std::uint8_t> pass(const std::vector<std::uint8_t>& bytes, std::uint64_t now_us);

 private:
  std::uint64_t next();

  std::uint64_t state_;
  Kind kind_ = Kind::kCorrupt;
  double share_ = 0;
  std::uint64_t until_us_ = 0;
};

}  // namespace foldcar
