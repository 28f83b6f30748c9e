#include "compact_path.h"

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace foldcar {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kPlace_m = 0.0005;
constexpr double kAngle_rad = 0.002;
constexpr std::size_t kHeading = 4;  // its place in a row

void append_varint(std::int64_t value, std::string& bytes) {
  std::uint64_t left = (static_cast<std::uint64_t>(value) << 1) ^ (value < 0 ? ~std::uint64_t{0} : 0);
  for (; left >= 0x80; left >>= 7) bytes.push_back(static_cast<char>((left & 0x7F) | 0x80));
  bytes.push_back(static_cast<char>(left));
}

std::string base64(const std::string& bytes) {
  static const char* const kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8 | (at + k < bytes.size() ? static_cast<unsigned char>(bytes[at + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text.push_back(at + k <= bytes.size() ? kDigits[group >> (18 - 6 * k) & 0x3F] : '=');
    }
  }
  return text;
}

}  // namespace

std::string compact_path(const std::vector<PathRow>& path) {
  std::string bytes;
  const std::size_t columns = path.empty() ? 0 : path.front().size();
  for (std::size_t column = 1; column < columns; ++column) {
    const double unit = column < kHeading ? kPlace_m : kAngle_rad;
    std::int64_t before = 0, step_before = 0;
    double turns = 0;
    for (std::size_t row = 0; row < path.size(); ++row) {
      if (column == kHeading && row > 0) {
        turns -= std::round((path[row][column] - path[row - 1][column]) / (2 * kPi));
      }
      const auto value = static_cast<std::int64_t>(std::nearbyint((path[row][column] + 2 * kPi * turns) / unit));
      const std::int64_t step = value - before;
      append_varint(step - step_before, bytes);
      before = value;
      step_before = step;
    }
  }
  return base64(bytes);
}

}  // namespace foldcar
