#include "body_spec.h"

#include <algorithm>
#include <cmath>

#include "elementary_functions.h"  // every program and suite of the simulator links this file

namespace foldcar {

std::size_t main_segment(const BodySpec& body) {
  auto distance_m = [](const SegmentSpec& segment) {
    return std::max(0.0, std::abs(segment.x_m) - 0.5 * segment.length_m);
  };
  std::size_t nearest = 0;
  for (std::size_t j = 1; j < body.segments.size(); ++j) {
    if (distance_m(body.segments[j]) < distance_m(body.segments[nearest])) nearest = j;
  }
  return nearest;
}

}  // namespace foldcar
