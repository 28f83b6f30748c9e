// Reads car.json with ArduinoJson, as the board does.
//
// Input: the file's text. Output: the design, or why it is refused. Takes memory from the heap and gives all of it back. It
// needs no board, so that tests compare it with the simulator's reading.
#pragma once

#include <ArduinoJson.h>

#include <cstddef>

#include "car_design.h"

namespace foldcar {
namespace design_json {

inline void take(CarDesignReader& reader, const DesignPlace& place, JsonVariantConst value) {
  if (value.is<const char*>()) {
    reader.text(place, value.as<const char*>());
  } else if (value.is<double>()) {  // whole numbers too
    reader.number(place, value.as<double>());
  } else {
    reader.refuse_key(place);
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
  if (reader.accepts(text, size)) {
    JsonDocument document;
    if (deserializeJson(document, text, size)) {
      reader.refuse("cannot be read: no memory is left");
    } else {
      design_json::take_all(reader, document.as<JsonObjectConst>());
    }
  }
  return reader.result();
}

}  // namespace foldcar
