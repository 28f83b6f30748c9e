#include "line_noise.h"

namespace foldcar {

void LineNoise::set(Kind kind, double probability, std::uint64_t until_us) {
  kind_ = kind;
  probability_ = probability;
  until_us_ = until_us;
}

// Returns the bytes as they arrive: until until_us each is dropped or changed with the set probability.
std::vector<std::uint8_t> LineNoise::pass(const std::vector<std::uint8_t>& bytes, std::uint64_t now_us) {
  if (now_us >= until_us_ || probability_ <= 0) return bytes;
  std::vector<std::uint8_t> arrived;
  for (const std::uint8_t byte : bytes) {
    // The upper 53 bits are a whole number below 2^53, which a double holds exactly.
    const bool is_hit = static_cast<double>(next() >> 11) < probability_ * 9007199254740992.0;  // 2^53
    if (!is_hit) {
      arrived.push_back(byte);
    } else if (kind_ == Kind::kCorrupt) {
      // Changes at least one bit.
      arrived.push_back(static_cast<std::uint8_t>(byte ^ (1 + next() % 255)));
    }
  }
  return arrived;
}

// SplitMix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators, 2014).
std::uint64_t LineNoise::next() {
  state_ += 0x9E3779B97F4A7C15u;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  return z ^ (z >> 31);
}

}  // namespace foldcar
