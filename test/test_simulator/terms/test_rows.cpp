// Rows and matrices of fixed lengths: every number of velocities that a car can have, against sums of plain loops.
#include "../../suite.h"

#include <cmath>
#include <numeric>
#include <vector>

#include "row_vector.h"
#include "square_matrix.h"

using namespace foldcar;

namespace {

constexpr std::size_t kMinVelocities = 8, kMaxVelocities = 21;

// The numbers of a symmetric matrix whose diagonal outweighs the rest of each row.
double entry(std::size_t i, std::size_t j) {
  return (i == j ? 10.0 : 0.0) + std::sin(static_cast<double>(i + j + 1) + static_cast<double>(i * j));
}

}  // namespace

TEST(test_every_car_fits_into_a_row) {
  for (std::size_t size = kMinVelocities; size <= kMaxVelocities; ++size) {
    TEST_ASSERT_TRUE(row_length(size) >= size && row_length(size) <= kMaxRowLength && row_length(size) % 4 == 2);
  }
}

TEST(test_a_matrix_times_a_column_of_its_inverse_is_a_column_of_the_identity) {
  for (std::size_t size = kMinVelocities; size <= kMaxVelocities; ++size) {
    SquareMatrix matrix(size);
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) matrix.at(i, j) = entry(i, j);
    }
    SquareMatrix inverse = matrix;
    inverse.invert();
    std::vector<double> product(row_length(size), -1);
    for (std::size_t j = 0; j < size; ++j) {
      matrix.multiply(inverse.column(j), product.data());
      for (std::size_t i = 0; i < product.size(); ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-12, i == j ? 1 : 0, product[i]);
    }
  }
}

TEST(test_a_row_vector_has_the_sums_of_plain_loops) {
  std::vector<double> velocity(kMaxVelocities), row(kMaxRowLength);
  for (std::size_t i = 0; i < kMaxVelocities; ++i) velocity[i] = entry(i, 2);
  for (std::size_t i = 0; i < kMaxRowLength; ++i) row[i] = entry(i, 5);
  RowVector<kMaxRowLength> changed(velocity);
  const double dot = std::inner_product(velocity.begin(), velocity.end(), row.begin(), 0.0);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, dot, changed.dot(row.data()));
  changed.add(-0.25, row.data());
  std::vector<double> result(kMaxRowLength);
  changed.store(result);
  for (std::size_t i = 0; i < kMaxRowLength; ++i) {
    TEST_ASSERT_EQUAL_DOUBLE((i < kMaxVelocities ? velocity[i] : 0) - 0.25 * row[i], result[i]);
  }
}
