// A square matrix of the car's dynamics. It is stored by columns: a product with a vector is a sum of columns, which
// vector registers add side by side.
#pragma once

#include <cstddef>
#include <vector>

#include "row_vector.h"

namespace foldcar {

class SquareMatrix {
 public:
  explicit SquareMatrix(std::size_t size) : size_(size), length_(row_length(size)), columns_(size * length_) {}

  double& at(std::size_t row, std::size_t column) { return columns_[column * length_ + row]; }
  double at(std::size_t row, std::size_t column) const { return columns_[column * length_ + row]; }
  // row_length(size) numbers, the last ones zeros.
  const double* column(std::size_t j) const { return &columns_[j * length_]; }
  void clear() { columns_.assign(columns_.size(), 0); }

  // Replaces a symmetric positive definite matrix by its inverse: Gauss-Jordan elimination, without pivoting.
  void invert() {
    for (std::size_t k = 0; k < size_; ++k) {
      const double pivot = 1 / at(k, k);
      at(k, k) = 1;
      for (std::size_t j = 0; j < size_; ++j) at(k, j) *= pivot;
      for (std::size_t i = 0; i < size_; ++i) {
        if (i == k) continue;
        const double factor = at(i, k);
        at(i, k) = 0;
        for (std::size_t j = 0; j < size_; ++j) at(i, j) -= factor * at(k, j);
      }
    }
  }

  // product = matrix · vector. The vector has as many numbers as the matrix has columns, the product row_length(size).
  void multiply(const double* vector, double* product) const {
    for (std::size_t i = 0; i < length_; i += 2) {
      RowVector<2> sums;
      for (std::size_t j = 0; j < size_; ++j) sums.add(vector[j], column(j) + i);
      sums.store(product + i);
    }
  }

 private:
  std::size_t size_, length_;
  std::vector<double> columns_;
};

}  // namespace foldcar
