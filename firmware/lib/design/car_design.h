// The design a car was built from, as its car.json says: name, hash, geometry, which output drives which wheel.
//
// CarDesignReader checks the file's values one by one as a JSON library comes upon them, so that board and
// simulator, which have different ones, refuse the same files with the same words. docs/firmware.md has the format.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "parameters.h"

namespace foldcar {

// The values are those of the MAVLink dialect.
enum class DesignSource : std::uint8_t { kNone, kFile, kRefused };

constexpr std::size_t kDesignNameLength = 32;
constexpr std::size_t kDesignHashLength = 16;
constexpr std::size_t kLargestDesignFile = 8192;

struct CarDesign {
  char name[kDesignNameLength + 1] = "";
  char hash[kDesignHashLength + 1] = "";
  float wheel_radius_m = 0.0f;
  float track_m = 0.0f;
  std::array<Side, kChannelCount> sides{};
  std::array<float, kChannelCount> directions{};
  std::array<std::optional<float>, kParameterCount> defaults{};  // instead of the table's
};

// What is known of the car's design: the design, or why there is none.
struct DesignResult {
  DesignSource source = DesignSource::kNone;
  CarDesign design;
  char problem[120] = "";
};

// Where in the file a value stands: key, or section.key, or section[index].key.
struct DesignPlace {
  const char* section = "";
  int index = -1;
  const char* key = "";
};

class CarDesignReader {
 public:
  // Every value of the file, in any order. Only the first problem counts.
  void number(const DesignPlace& place, double value);
  void text(const DesignPlace& place, const char* value);
  // A value that is neither, or one in a place where there is none.
  void other(const DesignPlace& place);
  // The file itself cannot be used: it is not JSON, too large, unreadable.
  void refuse(const char* problem);

  // To be called once, after the last value.
  DesignResult result();

 private:
  enum class Key : std::uint8_t { kFormat, kName, kHash, kWheelRadius, kTrack, kCount };
  struct Wheel {
    int channel = -1;
    std::optional<Side> side;
    float direction = 0.0f;
  };

  void wheel_number(const DesignPlace& place, double value);
  void parameter(const DesignPlace& place, double value);
  void top_number(const DesignPlace& place, double value);
  void in_limits(const DesignPlace& place, double value, Parameter limits_of, float& into);
  void fail(const DesignPlace& place, const char* problem);
  void check_wheels();
  bool first(const DesignPlace& place, Key key);

  CarDesign design_;
  std::array<bool, static_cast<std::size_t>(Key::kCount)> found_{};
  std::array<Wheel, kChannelCount> wheels_{};
  char problem_[sizeof(DesignResult::problem)] = "";
};

// Gives the parameters what the design says: its defaults, then what storage has, then what only the design sets.
// Returns how many stored values were refused.
std::size_t configure(Parameters& parameters, const DesignResult& design, Storage& storage);

}  // namespace foldcar
