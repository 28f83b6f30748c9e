#include "sim_hal.h"

#include <algorithm>

namespace foldcar {

bool SimServos::write_pulses(const PulsesUs& pulses_us) {
  if (!answers) return false;
  for (const float pulse_us : pulses_us) {
    if (!(pulse_us >= 0.0f && pulse_us <= kLongestOutputUs)) return false;
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
  const auto found = values.find(name);
  if (!fitted || found == values.end()) return false;
  value = found->second;
  return true;
}

bool SimStorage::save(const char* name, float value) {
  if (!fitted || !accepts) return false;
  values[name] = value;
  return true;
}

bool SimStorage::clear() {
  if (!fitted || !accepts) return false;
  values.clear();
  return true;
}

bool SimImu::read(ImuSample& sample) {
  if (fitted && answers) sample = now;
  return fitted && answers;
}

bool SimLogs::prepare() {
  if (logs.size() <= kLogsKept) return false;
  return remove(range().oldest);
}

std::uint16_t SimLogs::create() {
  if (!fitted || !accepts) return 0;
  open_ = next_log_number(range().newest);
  logs[open_].clear();
  return open_;
}

bool SimLogs::append(const std::uint8_t* data, std::size_t size) {
  if (open_ == 0 || !accepts) return false;
  logs[open_].append(reinterpret_cast<const char*>(data), size);
  return true;
}

bool SimLogs::close() {
  const bool was_open = open_ != 0;
  open_ = 0;
  return was_open;
}

std::size_t SimLogs::size(std::uint16_t id) {
  const auto log = logs.find(id);
  return log == logs.end() ? 0 : log->second.size();
}

std::size_t SimLogs::read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) {
  const auto log = logs.find(id);
  if (log == logs.end() || offset >= log->second.size()) return 0;
  return log->second.copy(reinterpret_cast<char*>(data), size, offset);
}

bool SimLogs::remove(std::uint16_t id) { return id != open_ && logs.erase(id) > 0; }

LogRange SimLogs::range() const {
  LogRange result;
  for (const auto& [id, content] : logs) result.add(id);
  return result;
}

}  // namespace foldcar
