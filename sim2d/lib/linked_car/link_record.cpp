#include "link_record.h"

#include <istream>

namespace foldcar {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr Limits kTime_us{0, 1e13};
// The keys of a host's bytes, and of those that waited while the simulation stood still.
constexpr const char* kToCar = "to_car";
constexpr const char* kLate = "to_car_late";

std::string to_hex(const std::vector<std::uint8_t>& bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

std::vector<std::uint8_t> from_hex(JsonReader& reader, const char* key) {
  const std::string text = reader.string(key);
  if (text.size() % 2 != 0 || text.find_first_not_of("0123456789abcdef") != std::string::npos) {
    reader.fail(key, "is not bytes in lower-case hexadecimal digits");
  }
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i < text.size(); i += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

// Steps the car until t_us and records what it sends.
void step_to(std::uint64_t t_us, LinkedCar& car, LinkRecord& record) {
  while (car.now_us() < t_us) {
    const std::vector<std::uint8_t> sent = car.step();
    record.from_car(car.now_us(), sent);
  }
}

// Repeats one line. Returns true if it was the end of the record.
bool replay_line(const json& line, LinkedCar& car, LinkRecord& record) {
  JsonReader reader(line, "line");
  const auto t_us = static_cast<std::uint64_t>(reader.number("t_us", kTime_us));
  if (reader.has("from_car")) return false;
  if (t_us < car.now_us()) reader.fail("t_us", std::to_string(t_us) + " is before the line above it");
  step_to(t_us, car, record);
  const bool late = reader.has(kLate);
  if (late || reader.has(kToCar)) {
    const std::vector<std::uint8_t> bytes = from_hex(reader, late ? kLate : kToCar);
    reader.finish();
    record.to_car(t_us, bytes, late);
    car.receive(bytes, late);
    return false;
  }
  if (reader.has("end")) return true;
  json injection = line;
  injection.erase("t_us");
  car.inject(read_injection(injection));
  record.inject(t_us, injection);
  return false;
}

}  // namespace

void LinkRecord::to_car(std::uint64_t t_us, const std::vector<std::uint8_t>& bytes, bool late) {
  if (!bytes.empty()) out_ << ordered_json{{"t_us", t_us}, {late ? kLate : kToCar, to_hex(bytes)}}.dump() << '\n';
}

void LinkRecord::from_car(std::uint64_t t_us, const std::vector<std::uint8_t>& bytes) {
  if (!bytes.empty()) out_ << ordered_json{{"t_us", t_us}, {"from_car", to_hex(bytes)}}.dump() << '\n';
}

void LinkRecord::inject(std::uint64_t t_us, const json& line) {
  ordered_json stamped = {{"t_us", t_us}};
  stamped.update(line);
  out_ << stamped.dump() << '\n';
}

void LinkRecord::end(std::uint64_t t_us) { out_ << ordered_json{{"t_us", t_us}, {"end", true}}.dump() << '\n'; }

void replay(std::istream& lines, LinkedCar& car, LinkRecord& record) {
  std::string line;
  for (std::size_t number = 1; std::getline(lines, line); ++number) {
    try {
      if (replay_line(parse_object(line), car, record)) return record.end(car.now_us());
    } catch (const InputError& error) {
      throw InputError("line " + std::to_string(number) + ": " + error.what());
    }
  }
  throw InputError("the record has no end");
}

}  // namespace foldcar
