// Record of a session with a linked car: its input and output with their simulated times, as JSON Lines (docs/carsim.md).
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "injection.h"
#include "linked_car.h"

namespace foldcar {

// Writes the lines of a session. t_us: simulated time (µs).
class LinkRecord {
 public:
  explicit LinkRecord(std::ostream& out) : out_(out) {}
  void to_car(std::uint64_t t_us, const std::vector<std::uint8_t>& bytes, bool late);
  void from_car(std::uint64_t t_us, const std::vector<std::uint8_t>& bytes);
  void inject(std::uint64_t t_us, const nlohmann::json& line);
  void end(std::uint64_t t_us);

 private:
  std::ostream& out_;
};

// Repeats the input of a record at its times and records the session again. Throws InputError, which names the line, if a
// line is wrong or the record has no end.
void replay(std::istream& lines, LinkedCar& car, LinkRecord& record);

}  // namespace foldcar
