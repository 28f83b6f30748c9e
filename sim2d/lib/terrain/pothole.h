// A round hole: -depth · t²(3 - 2t) with t = (radius - r)/edge, at most 1, at the distance r from its middle.
#pragma once

#include <vector>

#include "ground_field.h"
#include "scene_spec.h"

namespace foldcar {

// Smooth along its wall, flat at its bottom.
class Pothole : public GroundField {
 public:
  explicit Pothole(const PotholeSpec& spec) : spec_(spec) {}
  Disc reach() const override { return {spec_.x_m, spec_.y_m, spec_.radius_m}; }
  double height_m(double x_m, double y_m) const override;
  void add_along(const Ray& ray, const std::vector<double>& s_m, std::vector<double>& z_m) const override;
  double curvature_1_m(const Disc& disc) const override;

 private:
  PotholeSpec spec_;
};

}  // namespace foldcar
