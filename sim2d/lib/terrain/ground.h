// The smooth ground: the sum of the scene's hills, potholes and rough fields.
#pragma once

#include <memory>
#include <vector>

#include "ground_field.h"
#include "scene_spec.h"

namespace foldcar {

// The fields of one scene.
class Ground {
 public:
  explicit Ground(const TerrainSpec& spec);

  bool flat() const { return fields_.empty(); }
  // Height at a point of the world.
  double height_m(double x_m, double y_m) const;
  // Fills found with the fields that are not 0 everywhere in the disc.
  void find(const Disc& disc, std::vector<const GroundField*>& found) const;

 private:
  std::vector<std::unique_ptr<const GroundField>> fields_;
};

}  // namespace foldcar
