#include "flash_design.h"

#include <Arduino.h>
// Here too, because PlatformIO's finder follows what sources include, and design_json is a header alone.
#include <ArduinoJson.h>
#include <LittleFS.h>

#include <memory>

#include "design_json.h"

namespace foldcar {
namespace {

constexpr const char* kDesignFile = "/car.json";

}  // namespace

DesignResult read_stored_design() {
  const bool mounted = LittleFS.begin(false);
  DesignResult absent;
  absent.source = mounted ? DesignSource::kMissing : DesignSource::kUnreadable;
  if (!mounted || !LittleFS.exists(kDesignFile)) return absent;
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
  const std::size_t size = file.size();
  const std::unique_ptr<char[]> text(new char[size]);
  if (file.read(reinterpret_cast<std::uint8_t*>(text.get()), size) != size) {
    reader.refuse("cannot be read");
    return reader.result();
  }
  return read_design_json(text.get(), size);
}

}  // namespace foldcar
