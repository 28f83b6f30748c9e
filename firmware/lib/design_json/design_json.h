// Reads car.json with ArduinoJson, as the board does.
//
// Input: the file's text. Output: the design, or why it is refused. Takes memory from the heap and gives all of it back. It
// needs no board, so that tests compare it with the simulator's reading.
#pragma once

#include <ArduinoJson.h>

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "car_design.h"

namespace foldcar {
namespace design_json {

// The text as a stream. ArduinoJson stops after the first JSON value; what is left must be space only.
class Text {
 public:
  Text(const char* text, std::size_t size) : next_(text), end_(text + size) {}

  int read() { return next_ < end_ ? static_cast<unsigned char>(*next_++) : -1; }

  std::size_t readBytes(char* into, std::size_t size) {
    const std::size_t count = std::min<std::size_t>(size, static_cast<std::size_t>(end_ - next_));
    std::memcpy(into, next_, count);
    next_ += count;
    return count;
  }

  bool only_space_left() const {
    return std::all_of(next_, end_, [](char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; });
  }

 private:
  const char* next_;
  const char* end_;
};

inline void take(CarDesignReader& reader, const DesignPlace& place, JsonVariantConst value) {
  if (value.is<const char*>()) {
    reader.text(place, value.as<const char*>());
  } else if (value.is<double>()) {  // whole numbers too
    reader.number(place, value.as<double>());
  } else {
    reader.other(place);
  }
}

inline void take_section(CarDesignReader& reader, const char* section, int index, JsonObjectConst values) {
  for (JsonPairConst pair : values) take(reader, {section, index, pair.key().c_str()}, pair.value());
}

inline void take_all(CarDesignReader& reader, JsonObjectConst root) {
  for (JsonPairConst pair : root) {
    const char* key = pair.key().c_str();
    const JsonVariantConst value = pair.value();
    if (value.is<JsonObjectConst>()) {
      take_section(reader, key, -1, value.as<JsonObjectConst>());
    } else if (value.is<JsonArrayConst>()) {
      int index = 0;
      for (JsonVariantConst element : value.as<JsonArrayConst>()) {
        if (element.is<JsonObjectConst>()) {
          take_section(reader, key, index, element.as<JsonObjectConst>());
        } else {
          take(reader, {key, index, ""}, element);
        }
        ++index;
      }
    } else {
      take(reader, {"", -1, key}, value);
    }
  }
}

}  // namespace design_json

// text: size bytes, which need no closing zero.
inline DesignResult read_design_json(const char* text, std::size_t size) {
  CarDesignReader reader;
  if (size > kLargestDesignFile) {
    reader.refuse("is larger than 8192 bytes");
    return reader.result();
  }
  JsonDocument document;
  design_json::Text input(text, size);
  const DeserializationError error = deserializeJson(document, input);
  if (error || !document.is<JsonObjectConst>() || !input.only_space_left()) {
    reader.refuse("is not a JSON object");
  } else {
    design_json::take_all(reader, document.as<JsonObjectConst>());
  }
  return reader.result();
}

}  // namespace foldcar
