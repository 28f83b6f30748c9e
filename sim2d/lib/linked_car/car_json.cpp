#include "car_json.h"

#include <nlohmann/json.hpp>

namespace foldcar {
namespace {

using nlohmann::json;

void take(CarDesignReader& reader, const DesignPlace& place, const json& value) {
  if (value.is_number()) {
    reader.number(place, value.get<double>());
  } else if (value.is_string()) {
    reader.text(place, value.get_ref<const std::string&>().c_str());
  } else {
    reader.refuse_key(place);
  }
}

void take_section(CarDesignReader& reader, const char* section, int index, const json& values) {
  for (const auto& [key, value] : values.items()) take(reader, {section, index, key.c_str()}, value);
}

}  // namespace

DesignResult read_car_json(const std::string& text) {
  CarDesignReader reader;
  if (reader.accepts(text.data(), text.size())) {
    const json root = json::parse(text);
    for (const auto& [key, value] : root.items()) {
      if (value.is_object()) {
        take_section(reader, key.c_str(), -1, value);
      } else if (value.is_array()) {
        int index = 0;
        for (const json& element : value) {
          if (element.is_object()) {
            take_section(reader, key.c_str(), index++, element);
          } else {
            take(reader, {key.c_str(), index++, ""}, element);
          }
        }
      } else {
        take(reader, {"", -1, key.c_str()}, value);
      }
    }
  }
  return reader.result();
}

}  // namespace foldcar
