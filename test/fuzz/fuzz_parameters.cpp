// Names and values as a host sets them or flash returns them: pieces of 20 bytes, a name of 16 and a float. Every parameter
// stays within its limits, and a value that was refused changes nothing.
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "parameters.h"
#include "sim_hal.h"

namespace {

constexpr std::size_t kName = 16;

void check(const foldcar::Parameters& parameters) {
  for (std::size_t i = 0; i < foldcar::kParameterCount; ++i) {
    const float value = parameters.get(static_cast<foldcar::Parameter>(i));
    const foldcar::ParameterInfo& info = foldcar::parameter_table()[i];
    if (!(value >= info.minimum && value <= info.maximum)) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  foldcar::SimHal board;
  foldcar::Parameters parameters;
  for (; size >= kName + sizeof(float); data += kName + sizeof(float), size -= kName + sizeof(float)) {
    char name[kName + 1] = "";
    std::memcpy(name, data, kName);
    float value = 0;
    std::memcpy(&value, data + kName, sizeof value);
    parameters.set(name, value);
    check(parameters);
    board.storage.values[name] = value;
  }
  foldcar::Parameters loaded;
  loaded.load(board.storage);
  check(loaded);
  return 0;
}
