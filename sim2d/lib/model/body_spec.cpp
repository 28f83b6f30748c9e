#include "body_spec.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

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

void check_plain_tyres(const BodySpec& body, const std::string& engine) {
  for (std::size_t i = 0; i < body.wheels.size(); ++i) {
    const WheelSpec& wheel = body.wheels[i];
    const char* key = wheel.camber_rad != 0 ? "camber_rad" : "contact_time_s";
    if (wheel.camber_rad == 0 && wheel.contact_time_s == kContactTime_s) continue;
    throw std::runtime_error("body " + body.id + ": wheels." + std::to_string(i) + "." + key + ": " + engine +
                             " has no such tyres, MuJoCo has");
  }
}

}  // namespace foldcar
