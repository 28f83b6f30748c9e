#include "ground.h"

#include "hill.h"
#include "pothole.h"
#include "rough.h"

namespace foldcar {

Ground::Ground(const TerrainSpec& spec) {
  for (const HillSpec& hill : spec.hills) fields_.push_back(std::make_unique<Hill>(hill));
  for (const PotholeSpec& pothole : spec.potholes) fields_.push_back(std::make_unique<Pothole>(pothole));
  for (const RoughSpec& rough : spec.roughs) fields_.push_back(std::make_unique<Rough>(rough));
}

double Ground::height_m(double x_m, double y_m) const {
  double height_m = 0;
  for (const auto& field : fields_) height_m += field->height_m(x_m, y_m);
  return height_m;
}

void Ground::find(const Disc& disc, std::vector<const GroundField*>& found) const {
  found.clear();
  for (const auto& field : fields_) {
    if (overlap(field->reach(), disc)) found.push_back(field.get());
  }
}

}  // namespace foldcar
