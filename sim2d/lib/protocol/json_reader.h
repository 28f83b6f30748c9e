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

namespace foldcar {

// Input that breaks a rule; the message names key, value and limit.
class InputError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Parses one line. InputError if it is no JSON object, has a key twice or is nested beyond any need.
nlohmann::json parse_object(const std::string& line);

// The range of a number, both ends included.
struct Limits {
  double minimum;
  double maximum;
};

// Reads the keys of one object; every method throws InputError.
class JsonReader {
 public:
  // value must outlive the reader; path names it in messages.
  JsonReader(const nlohmann::json& value, std::string path);

  bool has(const char* key) const;
  bool is_null(const char* key) { return at(key).is_null(); }
  double number(const char* key, Limits limits);
  double number_or(const char* key, Limits limits, double otherwise);
  int integer(const char* key, int minimum, int maximum);
  std::string string(const char* key);
  // The index of the key's value in names.
  std::size_t choice(const char* key, const std::vector<std::string>& names);
  JsonReader object(const char* key);
  // The elements of an array of objects.
  std::vector<JsonReader> objects(const char* key, std::size_t minimum, std::size_t maximum);
  // An array of at most so many numbers.
  std::vector<double> list(const char* key, Limits limits, std::size_t most);
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
  std::set<std::string> used_;
};

}  // namespace foldcar
