#include "sim_hal.h"

#include <algorithm>
#include <cmath>

namespace foldcar {

bool SimServos::write_pulses(const PulsesUs& pulses_us) {
  if (!answers) return false;
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

bool SimStorage::clear() {
  values_.clear();
  return true;
}

bool SimImu::read(ImuSample& sample) {
  if (fitted && answers) sample = now;
  return fitted && answers;
}

bool SimLogs::create(std::uint16_t id) {
  open_ = id;
  logs_[id].clear();
  return true;
}

bool SimLogs::append(const std::uint8_t* data, std::size_t size) {
  const auto log = logs_.find(open_);
  if (log == logs_.end()) return false;
  log->second.insert(log->second.end(), data, data + size);
  return true;
}

bool SimLogs::close() {
  open_ = 0;
  return true;
}

std::size_t SimLogs::size(std::uint16_t id) {
  const auto log = logs_.find(id);
  return log == logs_.end() ? 0 : log->second.size();
}

std::size_t SimLogs::read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) {
  const auto log = logs_.find(id);
  if (log == logs_.end() || offset >= log->second.size()) return 0;
  const std::size_t count = std::min(size, log->second.size() - offset);
  std::copy_n(log->second.begin() + static_cast<std::ptrdiff_t>(offset), count, data);
  return count;
}

bool SimLogs::remove(std::uint16_t id) { return logs_.erase(id) > 0; }

bool SimLogs::range(std::uint16_t& first, std::uint16_t& last) {
  if (logs_.empty()) return false;
  first = logs_.begin()->first;
  last = logs_.rbegin()->first;
  return true;
}

}  // namespace foldcar
