// Texts as car.json: what is accepted configures parameters that all keep their limits.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>

#include "car_json.h"
#include "sim_hal.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const foldcar::DesignResult design = foldcar::read_car_json({reinterpret_cast<const char*>(data), size});
  if (design.source != foldcar::DesignSource::kFile && design.source != foldcar::DesignSource::kRefused) std::abort();
  // A refusal says why, in one line that ends within its buffer.
  const std::size_t problem = strnlen(design.problem, sizeof design.problem);
  if (problem == sizeof design.problem) std::abort();
  if ((design.source == foldcar::DesignSource::kRefused) != (problem > 0)) std::abort();
  foldcar::SimHal board;
  foldcar::Parameters parameters;
  foldcar::configure(parameters, design, board.storage);
  for (std::size_t i = 0; i < foldcar::kParameterCount; ++i) {
    const float value = parameters.get(static_cast<foldcar::Parameter>(i));
    const foldcar::ParameterInfo& info = foldcar::parameter_table()[i];
    if (!(value >= info.minimum && value <= info.maximum)) std::abort();
  }
  return 0;
}
