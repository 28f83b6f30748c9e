// What the two fuzzers of carsim's lines share: each input is one session's lines; half of the mutations change one number
// or key of one line and leave it JSON.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace foldcar {

// Trials are cut to a few steps, so that time is spent on the parsers and on putting cars down.
inline constexpr double kFuzzedTrial_s = 0.05;
// The most CPU time that a line may cost, sanitizers included.
inline constexpr double kMostForALine_s = 20;

inline double cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

inline std::vector<std::string> split(const std::uint8_t* data, std::size_t size) {
  std::istringstream text(std::string(reinterpret_cast<const char*>(data), size));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

inline std::string dumped(const nlohmann::json& value) {
  return value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

// The line with its time limits cut, or as it is if it is no JSON.
inline std::string shortened(const std::string& line) {
  nlohmann::json value = nlohmann::json::parse(line, nullptr, false);
  if (!value.is_object()) return line;
  bool changed = false;
  for (auto& [kind, content] : value.items()) {
    if (!content.is_object()) continue;
    for (const char* key : {"time_limit_s", "to_s"}) {
      const auto found = content.find(key);
      if (found == content.end() || !found->is_number() || found->get<double>() <= kFuzzedTrial_s) continue;
      *found = kFuzzedTrial_s;
      changed = true;
    }
  }
  return changed ? dumped(value) : line;
}

// Answers every line; a reply must be JSON and in time.
template <typename Session>
int answer_all(Session& session, const std::uint8_t* data, std::size_t size) {
  std::size_t number = 0;
  for (const std::string& line : split(data, size)) {
    const double before_s = cpu_s();
    const std::optional<std::string> reply = session.answer(++number, shortened(line));
    if (reply && !nlohmann::json::accept(*reply)) std::abort();
    if (cpu_s() - before_s > kMostForALine_s) std::abort();
  }
  return 0;
}

inline void collect_numbers(nlohmann::json& value, std::vector<nlohmann::json*>& numbers) {
  if (value.is_number()) numbers.push_back(&value);
  if (!value.is_structured()) return;
  for (auto& element : value) collect_numbers(element, numbers);
}

// One line with up to three of its numbers changed: to an edge, by a factor, or in sign.
inline std::size_t mutate_lines(std::uint8_t* data, std::size_t size, std::size_t max_size, unsigned seed) {
  static constexpr std::array<double, 14> kEdges = {0, -0.0, 1, -1, 0.001, 0.02, 0.5, 2, 3, 10, 1000, 1e-9, 1e300, -3};
  std::mt19937 random(seed);
  std::vector<std::string> lines = split(data, size);
  if (random() % 4 == 0 || lines.empty()) return LLVMFuzzerMutate(data, size, max_size);
  std::string& line = lines[random() % lines.size()];
  nlohmann::json value = nlohmann::json::parse(line, nullptr, false);
  std::vector<nlohmann::json*> numbers;
  if (!value.is_discarded()) collect_numbers(value, numbers);
  if (numbers.empty()) return LLVMFuzzerMutate(data, size, max_size);
  for (std::size_t count = 1 + random() % 3; count > 0; --count) {
    nlohmann::json& number = *numbers[random() % numbers.size()];
    const double was = number.get<double>();
    const std::array<double, 4> changed = {kEdges[random() % kEdges.size()], was * std::exp2(random() % 17 - 8.0),
                                           was * (1 + 1e-3 * (random() % 400)), -was};
    number = changed[random() % changed.size()];
  }
  line = dumped(value);
  std::string text;
  for (const std::string& one : lines) text += one + '\n';
  if (text.size() > max_size) return LLVMFuzzerMutate(data, size, max_size);
  std::memcpy(data, text.data(), text.size());
  return text.size();
}

}  // namespace foldcar

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size, unsigned seed) {
  return foldcar::mutate_lines(data, size, max_size, seed);
}
