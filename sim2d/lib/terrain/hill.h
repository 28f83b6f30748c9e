// A Gaussian hill, or hollow: height · exp(-(a²/sd_along² + c²/sd_across²)/2), cut off at 4 standard deviations.
#pragma once

#include <vector>

#include "ground_field.h"
#include "scene_spec.h"

namespace foldcar {

// sd_* are standard deviations; the height is negative for a hollow.
class Hill : public GroundField {
 public:
  explicit Hill(const HillSpec& spec);
  Disc reach() const override { return reach_; }
  double height_m(double x_m, double y_m) const override;
  void add_along(const Ray& ray, const std::vector<double>& s_m, std::vector<double>& z_m) const override;
  double curvature_1_m(const Disc& disc) const override;

 private:
  Disc reach_;
  double height_m_, least_sd_m_;
  // From the world to the hill's axes in standard deviations: along = ax·dx + ay·dy, across = cx·dx + cy·dy.
  double ax_, ay_, cx_, cy_;
};

}  // namespace foldcar
