// Reads one JSON object strictly: every key is asked for once, with its type and limits, and none is left over.
//
// Errors are InputError with a message that names the key's path, its value and the limit.
#pragma once

#include <nlohmann/json.hpp>
#include <cstddef>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "input_limits.h"

namespace foldcar {

// Input that breaks a rule; the message names key, value and limit.
class InputError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Parses one line. InputError if it is no JSON object, has a key twice or is nested beyond any need.
nlohmann::json parse_object(const std::string& line);

// Reads the keys of one object; every method throws InputError.
class JsonReader {
 public:
  // value must outlive the reader; path names it in messages, kind is where its limits stand in input_limits.h.
  JsonReader(const nlohmann::json& value, std::string path, std::string kind);
  JsonReader(const nlohmann::json& value, const std::string& path) : JsonReader(value, path, path) {}

  bool has(const char* key) const;
  bool is_null(const char* key) { return at(key).is_null(); }
  // Within the limits of input_limits.h.
  double number(const char* key);
  double number_or(const char* key, double otherwise);
  int integer(const char* key);
  // Within limits that are none of the table's or depend on other numbers.
  double number(const char* key, Limits limits);
  int integer(const char* key, int minimum, int maximum);
  std::string string(const char* key);
  // The index of the key's value in names.
  std::size_t choice(const char* key, const std::vector<std::string>& names);
  JsonReader object(const char* key);
  // Of any type, unchecked.
  const nlohmann::json& value(const char* key) { return at(key); }
  // The elements of an array of objects, as many as input_limits.h allows, or within limits of one's own.
  std::vector<JsonReader> objects(const char* key);
  std::vector<JsonReader> objects(const char* key, std::size_t minimum, std::size_t maximum);
  // An array of numbers; as many as input_limits.h allows, and each within its limits.
  std::vector<double> list(const char* key);
  // From now on limits are looked up under that name below the present place: pieces of terrain differ by kind.
  void narrow(const std::string& name) { kind_ += "." + name; }
  // The limits of that key in input_limits.h.
  Limits limits(const char* key) const { return limits_of(kind_ + "." + key); }
  // Every key with a number, as an object of numbers.
  std::vector<std::pair<std::string, double>> numbers();

  // InputError if a key was never asked for.
  void finish() const;

  [[noreturn]] void fail(const std::string& key, const std::string& problem) const;

 private:
  const nlohmann::json& at(const char* key);
  void check_size(const char* key, const nlohmann::json& value, std::size_t maximum) const;
  double checked_number(const std::string& key, const nlohmann::json& value, Limits limits) const;

  const nlohmann::json* value_;
  std::string path_;
  std::string kind_;
  std::set<std::string> used_;
};

}  // namespace foldcar
