#include "json_reader.h"

#include <algorithm>
#include <cmath>

namespace foldcar {
namespace {

using nlohmann::json;

// Records of programs may have constants of 20 levels (host/foldcar/scenes/recorded.py), in an object of 5.
constexpr int kDeepest = 32;
constexpr std::size_t kShown = 60;  // bytes of a value in an error message

std::string shown(const json& value) {
  std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
  if (text.size() > kShown) text = text.substr(0, kShown) + "…";
  return text;
}

std::string shown(double value) { return json(value).dump(); }

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace

// Parses a line that must be a JSON object. Throws InputError also for a key that occurs twice in an object, which the
// library would accept, and for deep nesting: `keys` holds the keys seen in each object that is still open.
json parse_object(const std::string& line) {
  std::vector<std::set<std::string>> keys;
  auto watch = [&](int depth, json::parse_event_t event, json& parsed) {
    if (depth > kDeepest) throw InputError("nested deeper than " + std::to_string(kDeepest));
    if (event == json::parse_event_t::object_start) keys.emplace_back();
    if (event == json::parse_event_t::object_end) keys.pop_back();
    if (event == json::parse_event_t::key) {
      const auto key = parsed.get<std::string>();
      if (!keys.back().insert(key).second) throw InputError("the key " + shown(parsed) + " stands twice");
    }
    return true;
  };
  json value;
  try {
    value = json::parse(line, watch);
  } catch (const json::exception& error) {
    // The library's text starts with its own name and number: "[json.exception.parse_error.101] parse error …".
    const std::string text = error.what();
    const std::size_t start = text.find("] ");
    throw InputError("no JSON: " + (start == std::string::npos ? text : text.substr(start + 2)));
  }
  if (!value.is_object()) throw InputError("a line must be a JSON object, not " + shown(value));
  return value;
}

JsonReader::JsonReader(const json& value, std::string path, std::string kind)
    : value_(&value), path_(std::move(path)), kind_(std::move(kind)) {
  if (!value.is_object()) throw InputError(path_ + ": must be an object, not " + shown(value));
}

bool JsonReader::has(const char* key) const { return value_->contains(key); }

const json& JsonReader::at(const char* key) {
  used_.insert(key);
  const auto found = value_->find(key);
  if (found == value_->end()) fail(key, "is missing");
  return *found;
}

double JsonReader::checked_number(const std::string& key, const json& value, Limits limits) const {
  if (!value.is_number()) fail(key, "must be a number, not " + shown(value));
  const double number = value.get<double>();
  if (!std::isfinite(number)) fail(key, "must be finite");
  if (number < limits.minimum) fail(key, shown(number) + " is below the limit " + shown(limits.minimum));
  if (number > limits.maximum) fail(key, shown(number) + " is above the limit " + shown(limits.maximum));
  return number;
}

double JsonReader::number(const char* key, Limits limits) { return checked_number(key, at(key), limits); }

double JsonReader::number(const char* key) { return number(key, limits(key)); }

double JsonReader::number_or(const char* key, double otherwise) { return has(key) ? number(key) : otherwise; }

int JsonReader::integer(const char* key) {
  const Limits within = limits(key);
  return integer(key, static_cast<int>(within.minimum), static_cast<int>(within.maximum));
}

int JsonReader::integer(const char* key, int minimum, int maximum) {
  const double value = number(key, {static_cast<double>(minimum), static_cast<double>(maximum)});
  if (value != std::floor(value)) fail(key, shown(value) + " is not a whole number");
  return static_cast<int>(value);
}

std::string JsonReader::string(const char* key) {
  const json& value = at(key);
  if (!value.is_string()) fail(key, "must be a string, not " + shown(value));
  return value.get<std::string>();
}

std::size_t JsonReader::choice(const char* key, const std::vector<std::string>& names) {
  const std::string name = string(key);
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) fail(key, shown(json(name)) + " is none of " + joined(names));
  return static_cast<std::size_t>(found - names.begin());
}

JsonReader JsonReader::object(const char* key) { return JsonReader(at(key), path_ + "." + key, kind_ + "." + key); }

// The number of objects is limited by the entry "<key>.count" of the limits.
std::vector<JsonReader> JsonReader::objects(const char* key) {
  const Limits count = limits((std::string(key) + ".count").c_str());
  return objects(key, static_cast<std::size_t>(count.minimum), static_cast<std::size_t>(count.maximum));
}

std::vector<JsonReader> JsonReader::objects(const char* key, std::size_t minimum, std::size_t maximum) {
  const json& value = at(key);
  if (!value.is_array()) fail(key, "must be an array, not " + shown(value));
  if (value.size() < minimum) {
    fail(key, "has " + std::to_string(value.size()) + " entries, at least " + std::to_string(minimum) + " are needed");
  }
  check_size(key, value, maximum);
  std::vector<JsonReader> readers;
  for (std::size_t i = 0; i < value.size(); ++i) {
    readers.emplace_back(value[i], path_ + "." + key + "." + std::to_string(i), kind_ + "." + key);
  }
  return readers;
}

std::vector<double> JsonReader::list(const char* key) {
  const json& value = at(key);
  if (!value.is_array()) fail(key, "must be an array, not " + shown(value));
  check_size(key, value, static_cast<std::size_t>(limits((std::string(key) + ".count").c_str()).maximum));
  const Limits within = limits(key);
  std::vector<double> numbers;
  for (std::size_t i = 0; i < value.size(); ++i) {
    numbers.push_back(checked_number(std::string(key) + "." + std::to_string(i), value[i], within));
  }
  return numbers;
}

void JsonReader::check_size(const char* key, const json& value, std::size_t maximum) const {
  if (value.size() <= maximum) return;
  fail(key, "has " + std::to_string(value.size()) + " entries, the limit is " + std::to_string(maximum));
}

std::vector<std::pair<std::string, double>> JsonReader::numbers() {
  std::vector<std::pair<std::string, double>> entries;
  for (const auto& [key, value] : value_->items()) {
    constexpr double kLargest = 1e12;
    used_.insert(key);
    entries.emplace_back(key, checked_number(key, value, {-kLargest, kLargest}));
  }
  return entries;
}

// Throws if the object has a key that nobody has read.
void JsonReader::finish() const {
  for (const auto& [key, value] : value_->items()) {
    if (used_.count(key) == 0) fail(key, "is not a key that belongs here");
  }
}

void JsonReader::fail(const std::string& key, const std::string& problem) const {
  throw InputError(path_ + "." + key + ": " + problem);
}

}  // namespace foldcar
