#include "rough.h"

#include <cstdint>

#include "elementary_functions.h"

namespace foldcar {
namespace {

constexpr double kCellsPerCorrelation = 8;
constexpr double kKernelReach = 4;  // standard deviations
// Curvature bounds are kept for blocks of kBlockCells × kBlockCells cells. The interpolated surface is curved only at
// the edges of its cells; chords about as long as a cell miss more of such kinks than of an evenly curved surface, by
// kKinkFactor.
constexpr std::size_t kBlockCells = 8;
constexpr double kKinkFactor = 1.4;

// Number of grid cells, at least 1, along a side.
double cells(double side_m, double correlation_m) {
  return std::max(1.0, std::ceil(side_m * kCellsPerCorrelation / correlation_m - 1e-9));
}

// The finaliser of SplitMix64 (Steele, Lea and Flood, 2014): every bit of the result depends on every bit of the
// input.
std::uint64_t hashed(std::uint64_t bits) {
  bits += 0x9e3779b97f4a7c15u;
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9u;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebu;
  return bits ^ (bits >> 31);
}

// Uniform noise of mean 0 and variance 1; the sum over the blur kernel is close to Gaussian.
double noise(int seed, std::int64_t column, std::int64_t row) {
  std::uint64_t bits = hashed(static_cast<std::uint64_t>(seed));
  bits = hashed(bits ^ static_cast<std::uint64_t>(column));
  bits = hashed(bits ^ static_cast<std::uint64_t>(row));
  constexpr double kRoot12 = 3.4641016151377544;
  return (static_cast<double>(bits >> 11) * 0x1p-53 - 0.5) * kRoot12;
}

// Gaussian weights with a standard deviation of sd_cells cells, scaled so that blurred white noise keeps its variance
// of 1.
std::vector<double> blur_kernel(double sd_cells) {
  const int reach = static_cast<int>(std::ceil(kKernelReach * sd_cells));
  std::vector<double> weights;
  double squares = 0;
  for (int i = -reach; i <= reach; ++i) {
    weights.push_back(exponential(-0.5 * i * i / (sd_cells * sd_cells)));
    squares += weights.back() * weights.back();
  }
  for (double& weight : weights) weight /= std::sqrt(squares);
  return weights;
}

// Factor that fades the heights out at the rectangle's rim: 0 at the first and last node of a side, 1 from fade_cells
// inside.
double window(std::size_t node, std::size_t cells_of_side, double fade_cells) {
  const double t = std::min(1.0, static_cast<double>(std::min(node, cells_of_side - node)) / fade_cells);
  return t * t * (3 - 2 * t);
}

}  // namespace

double Rough::node_count(const RoughSpec& spec) {
  return (cells(spec.length_m, spec.correlation_m) + 1) * (cells(spec.width_m, spec.correlation_m) + 1);
}

// Makes the grid of heights: white noise, blurred along and then across by Gaussians of correlation_m / √2, which
// gives the heights a Gaussian correlation of that length, times height_sd_m and the fade at the rim.
Rough::Rough(const RoughSpec& spec)
    : spec_(spec),
      cosine_(cosine(spec.heading_rad)),
      sine_(sine(spec.heading_rad)),
      cells_along_(static_cast<std::size_t>(cells(spec.length_m, spec.correlation_m))),
      cells_across_(static_cast<std::size_t>(cells(spec.width_m, spec.correlation_m))),
      per_m_along_(static_cast<double>(cells_along_) / spec.length_m),
      per_m_across_(static_cast<double>(cells_across_) / spec.width_m) {
  const double blur_m = spec.correlation_m / std::sqrt(2.0);
  const std::vector<double> along = blur_kernel(blur_m * per_m_along_), across = blur_kernel(blur_m * per_m_across_);
  const std::size_t columns = cells_along_ + 1, rows = cells_across_ + 1;
  // The blur across needs rows beyond the rectangle.
  const std::size_t noise_rows = rows + across.size() - 1;
  std::vector<float> blurred(noise_rows * columns);
  std::vector<double> line(columns + along.size() - 1);
  for (std::size_t row = 0; row < noise_rows; ++row) {
    for (std::size_t i = 0; i < line.size(); ++i) {
      line[i] = noise(spec.seed, static_cast<std::int64_t>(i), static_cast<std::int64_t>(row));
    }
    for (std::size_t column = 0; column < columns; ++column) {
      double sum = 0;
      for (std::size_t i = 0; i < along.size(); ++i) sum += along[i] * line[column + i];
      blurred[row * columns + column] = static_cast<float>(sum);
    }
  }
  node_m_.resize(rows * columns);
  std::vector<double> sums(columns);
  for (std::size_t row = 0; row < rows; ++row) {
    std::fill(sums.begin(), sums.end(), 0.0);
    for (std::size_t i = 0; i < across.size(); ++i) {
      const float* from = &blurred[(row + i) * columns];
      for (std::size_t column = 0; column < columns; ++column) sums[column] += across[i] * from[column];
    }
    const double fade_across = window(row, cells_across_, spec.correlation_m * per_m_across_);
    for (std::size_t column = 0; column < columns; ++column) {
      const double fade = fade_across * window(column, cells_along_, spec.correlation_m * per_m_along_);
      node_m_[row * columns + column] = static_cast<float>(spec.height_sd_m * fade * sums[column]);
    }
  }
  find_curvature();
}

Disc Rough::reach() const { return {spec_.x_m, spec_.y_m, 0.5 * hypotenuse(spec_.length_m, spec_.width_m)}; }

// Height at a place in cells from the rectangle's corner, bilinear between the four nodes around it; 0 outside.
double Rough::at(double along, double across) const {
  const bool is_inside = along >= 0 && across >= 0 && along < static_cast<double>(cells_along_) &&
                         across < static_cast<double>(cells_across_);
  if (!is_inside) return 0;
  const auto column = static_cast<std::size_t>(along), row = static_cast<std::size_t>(across);
  const double u = along - static_cast<double>(column), v = across - static_cast<double>(row);
  const float* near = &node_m_[row * (cells_along_ + 1) + column];
  const float* far = near + cells_along_ + 1;
  return (1 - v) * ((1 - u) * near[0] + u * near[1]) + v * ((1 - u) * far[0] + u * far[1]);
}

double Rough::height_m(double x_m, double y_m) const {
  const double dx = x_m - spec_.x_m, dy = y_m - spec_.y_m;
  return at((cosine_ * dx + sine_ * dy + 0.5 * spec_.length_m) * per_m_along_,
            (cosine_ * dy - sine_ * dx + 0.5 * spec_.width_m) * per_m_across_);
}

void Rough::add_along(const Ray& ray, const std::vector<double>& s_m, std::vector<double>& z_m) const {
  const double dx = ray.x_m - spec_.x_m, dy = ray.y_m - spec_.y_m;
  const double along = (cosine_ * dx + sine_ * dy + 0.5 * spec_.length_m) * per_m_along_;
  const double across = (cosine_ * dy - sine_ * dx + 0.5 * spec_.width_m) * per_m_across_;
  const double along_1_m = (cosine_ * ray.cosine + sine_ * ray.sine) * per_m_along_;
  const double across_1_m = (cosine_ * ray.sine - sine_ * ray.cosine) * per_m_across_;
  for (std::size_t i = 0; i < s_m.size(); ++i) z_m[i] += at(along + along_1_m * s_m[i], across + across_1_m * s_m[i]);
}

// Computes for every block of cells the largest curvature at its nodes: the larger principal one, from the second
// differences of the heights along, across and diagonally.
void Rough::find_curvature() {
  blocks_along_ = cells_along_ / kBlockCells + 1;
  blocks_across_ = cells_across_ / kBlockCells + 1;
  block_curvature_1_m_.assign(blocks_along_ * blocks_across_, 0);
  const auto stride = static_cast<std::ptrdiff_t>(cells_along_ + 1);
  for (std::size_t row = 1; row < cells_across_; ++row) {
    for (std::size_t column = 1; column < cells_along_; ++column) {
      const float* z = &node_m_[row * (cells_along_ + 1) + column];
      const double along = (z[-1] - 2 * z[0] + z[1]) * per_m_along_ * per_m_along_;
      const double across = (z[-stride] - 2 * z[0] + z[stride]) * per_m_across_ * per_m_across_;
      const double twist =
          (z[stride + 1] - z[stride - 1] - z[-stride + 1] + z[-stride - 1]) * 0.25 * per_m_along_ * per_m_across_;
      const double larger = std::abs(0.5 * (along + across)) + hypotenuse(0.5 * (along - across), twist);
      float& block = block_curvature_1_m_[row / kBlockCells * blocks_along_ + column / kBlockCells];
      block = std::max(block, static_cast<float>(kKinkFactor * larger));
    }
  }
}

// Returns the largest curvature (1/m) of the blocks of cells that the disc may touch; 0 outside the rectangle.
double Rough::curvature_1_m(const Disc& disc) const {
  const double dx = disc.x_m - spec_.x_m, dy = disc.y_m - spec_.y_m;
  auto block = [](double cell, std::size_t count) {
    return static_cast<std::size_t>(std::clamp(std::floor(cell / kBlockCells), 0.0, static_cast<double>(count - 1)));
  };
  const double along_m = cosine_ * dx + sine_ * dy + 0.5 * spec_.length_m;
  const double across_m = cosine_ * dy - sine_ * dx + 0.5 * spec_.width_m;
  const double r_m = disc.radius_m;
  if (along_m < -r_m || across_m < -r_m || along_m > spec_.length_m + r_m || across_m > spec_.width_m + r_m) return 0;
  float largest = 0;
  for (std::size_t row = block((across_m - r_m) * per_m_across_, blocks_across_);
       row <= block((across_m + r_m) * per_m_across_, blocks_across_); ++row) {
    for (std::size_t column = block((along_m - r_m) * per_m_along_, blocks_along_);
         column <= block((along_m + r_m) * per_m_along_, blocks_along_); ++column) {
      largest = std::max(largest, block_curvature_1_m_[row * blocks_along_ + column]);
    }
  }
  return largest;
}

}  // namespace foldcar
