#include "sim_hal.h"

#include <algorithm>
#include <cmath>

namespace foldcar {

bool SimServos::write_pulses(const PulsesUs& pulses_us) {
  for (const float pulse_us : pulses_us) {
    if (!std::isfinite(pulse_us) || pulse_us < 0) return false;
  }
  pulses_us_ = pulses_us;
  return true;
}

std::size_t SimLink::read(std::uint8_t* data, std::size_t size) {
  const std::size_t count = std::min(size, to_car.size());
  std::copy_n(to_car.begin(), count, data);
  to_car.erase(to_car.begin(), to_car.begin() + static_cast<std::ptrdiff_t>(count));
  return count;
}

std::size_t SimLink::write(const std::uint8_t* data, std::size_t size) {
  from_car.insert(from_car.end(), data, data + size);
  return size;
}

bool SimStorage::load(const char* name, float& value) {
  const auto found = values_.find(name);
  if (found == values_.end()) return false;
  value = found->second;
  return true;
}

bool SimStorage::save(const char* name, float value) {
  values_[name] = value;
  return true;
}

}  // namespace foldcar
