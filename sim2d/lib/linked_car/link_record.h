// What went into a linked car and what came out, each with its simulated time: JSON Lines, as docs/carsim.md has them.
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "injection.h"
#include "linked_car.h"

namespace foldcar {

// Writes the lines of a session as it goes.
class LinkRecord {
 public:
  explicit LinkRecord(std::ostream& out) : out_(out) {}
  void to_car(std::uint64_t t_us, const std::vector<std::uint8_t>& bytes);
  void from_car(std::uint64_t t_us, const std::vector<std::uint8_t>& bytes);
  void inject(std::uint64_t t_us, const nlohmann::json& line);
  void end(std::uint64_t t_us);

 private:
  std::ostream& out_;
};

// Gives the car what the record's lines gave it, at the same times, and records it anew. InputError if a line is
// wrong; the last one must be an end.
void replay(std::istream& lines, LinkedCar& car, LinkRecord& record);

}  // namespace foldcar
