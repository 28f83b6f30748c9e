// The design that a car was built from, as in its car.json: name, hash, geometry, and which output drives which wheel.
//
// Board and simulator parse JSON with different libraries. Both hand the file's text and then its values one by one to
// CarDesignReader, so that they refuse the same files with the same messages. docs/firmware.md describes the format.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "parameters.h"

namespace foldcar {

// Where the design comes from. Values as in the MAVLink dialect.
enum class DesignSource : std::uint8_t {
  kNone,       // the parameters alone, as someone has confirmed
  kFile,
  kRefused,    // the file is damaged or does not fit: there is no design
  kMissing,    // there is no file
  kUnreadable  // the flash's file system does not mount, so whether there is a file is unknown
};

// Whether there is no design although nobody has said that there should be none.
constexpr bool is_absent(DesignSource source) {
  return source == DesignSource::kMissing || source == DesignSource::kUnreadable;
}

// Longest name and exact length of the hash (bytes), largest file (bytes).
constexpr std::size_t kDesignNameLength = 32;
constexpr std::size_t kDesignHashLength = 16;
constexpr std::size_t kLargestDesignFile = 8192;

// The content of a valid file.
struct CarDesign {
  char name[kDesignNameLength + 1] = "";
  char hash[kDesignHashLength + 1] = "";
  float wheel_radius_m = 0.0f;
  float track_m = 0.0f;
  std::array<Side, kChannelCount> sides{};  // by channel, from 0
  std::array<float, kChannelCount> directions{};  // 1 or -1, of used channels
  std::array<std::optional<float>, kParameterCount> defaults{};  // replace the table's; by parameter
};

// The design, or why there is none; problem is one line for people.
struct DesignResult {
  DesignSource source = DesignSource::kNone;
  CarDesign design;
  char problem[120] = "";
};

// The place of a value in the file: key, section.key or section[index].key.
struct DesignPlace {
  const char* section = "";
  int index = -1;
  const char* key = "";
};

// Collects and checks the values of one file.
class CarDesignReader {
 public:
  // Whether the file's text, of size bytes, may be parsed: not too large, and JSON that every library reads alike. Else the
  // file is refused.
  bool accepts(const char* text, std::size_t size);
  // To be called for each number and each text of the file, in any order. The first problem is kept.
  void number(const DesignPlace& place, double value);
  void text(const DesignPlace& place, const char* value);
  // For a value that is neither, or one where the format has none.
  void refuse_key(const DesignPlace& place);
  // For a file that cannot be used as a whole: not JSON, too large, unreadable.
  void refuse(const char* problem);

  // The design. To be called once, after the last value.
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

// Sets the parameters: first the design's defaults, then the stored values, then those that only the design may set, which
// are fixed. Returns the number of stored values that were refused.
std::size_t configure(Parameters& parameters, const DesignResult& design, Storage& storage);

}  // namespace foldcar
