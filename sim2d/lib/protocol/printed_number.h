// Single-precision numbers in their shortest decimal form.
#pragma once

#include <cstdio>
#include <cstdlib>

namespace foldcar {

// The number of fewest decimal digits that is the same in single precision: 11.5, not 11.50000001.
inline double as_printed(float value) {
  char text[32];
  for (int digits = 1; digits <= 9; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, static_cast<double>(value));
    if (std::strtof(text, nullptr) == value) break;
  }
  return std::strtod(text, nullptr);
}

}  // namespace foldcar
