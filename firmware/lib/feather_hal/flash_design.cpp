#include "flash_design.h"

#include <Arduino.h>
#include <LittleFS.h>

#include <memory>

#include "design_json.h"

namespace foldcar {
namespace {

constexpr const char* kDesignFile = "/car.json";

}  // namespace

DesignResult read_stored_design() {
  if (!LittleFS.exists(kDesignFile)) return {};
  CarDesignReader reader;
  fs::File file = LittleFS.open(kDesignFile, FILE_READ);
  if (!file) {
    reader.refuse("cannot be read");
    return reader.result();
  }
  if (file.size() > kLargestDesignFile) {
    reader.refuse("is larger than 8192 bytes");
    return reader.result();
  }
  const std::unique_ptr<char[]> text(new char[file.size()]);
  const std::size_t size = file.read(reinterpret_cast<std::uint8_t*>(text.get()), file.size());
  return read_design_json(text.get(), size);
}

}  // namespace foldcar
