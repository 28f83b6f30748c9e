// Generalised velocities, or a row of the contact Jacobian, as a vector whose length the compiler knows.
//
// Rows are solved one after another, and each needs the velocities that the row before has changed. So these stay in
// vector registers, in pairs, which every processor has. The order of additions is fixed: results do not depend on the
// compiler.
#pragma once

#include <cstddef>
#include <cstring>
#include <vector>

namespace foldcar {

// Of the largest car: eight segments and eight wheels have 21 velocities.
constexpr std::size_t kMaxRowLength = 22;

// Length of the rows of a car with so many velocities: 10 (a rigid car with four wheels), 14, 18 or 22, the last numbers
// zeros. Each length is compiled by itself, and few are enough.
constexpr std::size_t row_length(std::size_t velocities) {
  return velocities <= 10 ? 10 : (velocities + 1) / 4 * 4 + 2;
}

template <std::size_t kSize>
class RowVector {
 public:
  RowVector() {
    for (Pair& pair : pairs_) pair = Pair{0, 0};
  }
  // At most kSize numbers; zeros follow.
  explicit RowVector(const std::vector<double>& numbers) : RowVector() {
    std::memcpy(pairs_, numbers.data(), numbers.size() * sizeof(double));
  }
  void store(double* numbers) const {
    for (std::size_t k = 0; k < kPairs; ++k) std::memcpy(numbers + 2 * k, &pairs_[k], sizeof(Pair));
  }
  // Copies the first numbers, as many as `numbers` holds.
  void store(std::vector<double>& numbers) const {
    std::memcpy(numbers.data(), pairs_, numbers.size() * sizeof(double));
  }

  // Dot product: four sums side by side, of every fourth product each, then their sum.
  double dot(const double* row) const {
    Pair sums[2] = {pairs_[0] * load(row), pairs_[1] * load(row + 2)};
    for (std::size_t k = 2; k < kPairs; ++k) sums[k % 2] += pairs_[k] * load(row + 2 * k);
    const Pair both = sums[0] + sums[1];
    return both[0] + both[1];
  }
  // Adds factor · row.
  void add(double factor, const double* row) {
    const Pair factors{factor, factor};
    for (std::size_t k = 0; k < kPairs; ++k) pairs_[k] += factors * load(row + 2 * k);
  }

 private:
  using Pair = double __attribute__((vector_size(16)));
  static_assert(kSize % 2 == 0);
  static constexpr std::size_t kPairs = kSize / 2;

  static Pair load(const double* from) {
    Pair pair;
    std::memcpy(&pair, from, sizeof pair);
    return pair;
  }

  Pair pairs_[kPairs];
};

}  // namespace foldcar
