// Rough ground: Gaussian random heights of standard deviation height_sd and autocorrelation
// exp(-distance²/(2·correlation²)) in a rectangle, fading to 0 over one correlation length at its edge.
//
// White noise from a hash of the seed and the node, on a grid of at most correlation/8, is blurred with a separable
// Gaussian of correlation/√2. The surface is the bilinear interpolation of that grid.
#pragma once

#include <cstddef>
#include <vector>

#include "ground_field.h"
#include "scene_spec.h"

namespace foldcar {

// The grid of heights of one rectangle.
class Rough : public GroundField {
 public:
  explicit Rough(const RoughSpec& spec);
  // What the grid of spec takes, before it is made.
  static double node_count(const RoughSpec& spec);

  Disc reach() const override;
  double height_m(double x_m, double y_m) const override;
  void add_along(const Ray& ray, const std::vector<double>& s_m, std::vector<double>& z_m) const override;
  double curvature_1_m(const Disc& disc) const override;

 private:
  void find_curvature();
  // Height at a place counted in cells from the rear right corner.
  double at(double along, double across) const;

  RoughSpec spec_;
  double cosine_, sine_;
  std::size_t cells_along_, cells_across_;
  double per_m_along_, per_m_across_;  // cells
  std::vector<float> node_m_;          // rows along, (cells_across_ + 1) of them
  std::size_t blocks_along_, blocks_across_;
  std::vector<float> block_curvature_1_m_;  // the largest of so many cells by as many
};

}  // namespace foldcar
