#include "car_design.h"

#include <cmath>
#include <cstdio>
#include <cstring>

#include "strict_json.h"

namespace foldcar {
namespace {

constexpr double kFormat = 1;

bool is_equal(const char* a, const char* b) { return std::strcmp(a, b) == 0; }

bool is_hash(const char* text) {
  return std::strlen(text) == kDesignHashLength && std::strspn(text, "0123456789abcdef") == kDesignHashLength;
}

// Whether the key is a number that the firmware does not use; it is for people and drawings.
bool is_for_others(const char* key) {
  return is_equal(key, "length_m") || is_equal(key, "width_m") || is_equal(key, "mass_kg");
}

bool is_fixed_by_design(Parameter parameter) {
  if (parameter == Parameter::kWheelRadiusM || parameter == Parameter::kTrackM) return true;
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
    if (parameter == channel_parameter(channel, ChannelParameter::kSide)) return true;
    if (parameter == channel_parameter(channel, ChannelParameter::kDirection)) return true;
  }
  return false;
}

}  // namespace

void CarDesignReader::number(const DesignPlace& place, double value) {
  if (is_equal(place.section, "wheels")) {
    wheel_number(place, value);
  } else if (is_equal(place.section, "parameters")) {
    parameter(place, value);
  } else if (place.section[0] == '\0') {
    top_number(place, value);
  } else {
    fail(place, "is unknown");
  }
}

void CarDesignReader::text(const DesignPlace& place, const char* value) {
  const bool top = place.section[0] == '\0';
  const bool is_wheel = place.index >= 0 && place.index < static_cast<int>(kChannelCount);
  if (is_equal(place.section, "wheels") && is_equal(place.key, "side") && is_wheel) {
    std::optional<Side>& side = wheels_[static_cast<std::size_t>(place.index)].side;
    if (is_equal(value, "left")) side = Side::kLeft;
    if (is_equal(value, "right")) side = Side::kRight;
    if (!side) fail(place, "is neither left nor right");
  } else if (top && is_equal(place.key, "name")) {
    if (!first(place, Key::kName)) return;
    const std::size_t length = std::strlen(value);
    if (length == 0 || length > kDesignNameLength) return fail(place, "is empty or longer than 32 bytes");
    std::memcpy(design_.name, value, length + 1);
  } else if (top && is_equal(place.key, "hash")) {
    if (!first(place, Key::kHash)) return;
    if (!is_hash(value)) return fail(place, "is not 16 hexadecimal digits");
    std::memcpy(design_.hash, value, sizeof design_.hash);
  } else {
    refuse_key(place);
  }
}

void CarDesignReader::refuse_key(const DesignPlace& place) { fail(place, "is unknown or not of its type"); }

bool CarDesignReader::accepts(const char* text, std::size_t size) {
  if (size > kLargestDesignFile) {
    refuse("is larger than 8192 bytes");
  } else if (!is_strict_json_object(text, size)) {
    refuse("is not a JSON object");
  } else {
    return true;
  }
  return false;
}

void CarDesignReader::refuse(const char* problem) {
  if (problem_[0] == '\0') std::snprintf(problem_, sizeof problem_, "car.json: %s", problem);
}

// Returns the design after all values have been read; refused, with the first problem, if anything is wrong or
// missing.
DesignResult CarDesignReader::result() {
  constexpr const char* kNames[] = {"format", "name", "hash", "wheel_radius_m", "track_m"};
  for (std::size_t key = 0; key < found_.size(); ++key) {
    if (!found_[key]) fail({"", -1, kNames[key]}, "is missing");
  }
  check_wheels();
  DesignResult result;
  result.source = problem_[0] == '\0' ? DesignSource::kFile : DesignSource::kRefused;
  if (result.source == DesignSource::kFile) result.design = design_;
  std::memcpy(result.problem, problem_, sizeof problem_);
  return result;
}

void CarDesignReader::wheel_number(const DesignPlace& place, double value) {
  if (place.index < 0 || place.index >= static_cast<int>(kChannelCount)) return fail(place, "is one wheel too many");
  Wheel& wheel = wheels_[static_cast<std::size_t>(place.index)];
  if (is_equal(place.key, "channel")) {
    if (!(value >= 1 && value <= static_cast<double>(kChannelCount)) || value != std::floor(value)) {
      return fail(place, "is not a whole number from 1 to 8");
    }
    wheel.channel = static_cast<int>(value) - 1;
  } else if (is_equal(place.key, "direction")) {
    if (value != 1 && value != -1) return fail(place, "is neither -1 nor 1");
    wheel.direction = static_cast<float>(value);
  } else if (!is_equal(place.key, "x_m")) {
    refuse_key(place);
  }
}

void CarDesignReader::parameter(const DesignPlace& place, double value) {
  const std::optional<Parameter> index = find_parameter(place.key);
  if (!index) return fail(place, foldcar::text(SetResult::kUnknownName));
  if (is_fixed_by_design(*index)) return fail(place, "follows from wheels, wheel_radius_m and track_m");
  // Stays 0 if the value is out of its limits: then the whole design is refused.
  float checked_value = 0.0f;
  in_limits(place, value, *index, checked_value);
  design_.defaults[static_cast<std::size_t>(*index)] = checked_value;
}

void CarDesignReader::top_number(const DesignPlace& place, double value) {
  if (is_equal(place.key, "format")) {
    if (first(place, Key::kFormat) && value != kFormat) fail(place, "is not 1, the format this firmware knows");
  } else if (is_equal(place.key, "wheel_radius_m")) {
    if (first(place, Key::kWheelRadius)) in_limits(place, value, Parameter::kWheelRadiusM, design_.wheel_radius_m);
  } else if (is_equal(place.key, "track_m")) {
    if (first(place, Key::kTrack)) in_limits(place, value, Parameter::kTrackM, design_.track_m);
  } else if (!is_for_others(place.key)) {
    refuse_key(place);
  }
}

// Stores a value in `into` if it is within the limits of the parameter limits_of, else refuses the design.
void CarDesignReader::in_limits(const DesignPlace& place, double value, Parameter limits_of, float& into) {
  Parameters scratch;
  const SetResult result = scratch.set(limits_of, static_cast<float>(value));
  if (result != SetResult::kOk) return fail(place, foldcar::text(result));
  into = static_cast<float>(value);
}

// Refuses the design, with place and problem in the text. Only the first problem is kept.
void CarDesignReader::fail(const DesignPlace& place, const char* problem) {
  if (problem_[0] != '\0') return;
  if (place.section[0] == '\0') {
    std::snprintf(problem_, sizeof problem_, "car.json: %.40s %s", place.key, problem);
  } else if (place.index < 0) {
    std::snprintf(problem_, sizeof problem_, "car.json: %.20s.%.40s %s", place.section, place.key, problem);
  } else {
    std::snprintf(problem_, sizeof problem_, "car.json: %.16s[%d].%.24s %s", place.section, place.index, place.key,
                  problem);
  }
}

// Assigns the wheels to their outputs. Each needs channel, side and direction, no output may have two wheels, and both
// sides of the car need one.
void CarDesignReader::check_wheels() {
  bool left = false, right = false;
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    const Wheel& wheel = wheels_[i];
    const DesignPlace place{"wheels", static_cast<int>(i), "channel"};
    if (wheel.channel < 0 && !wheel.side && wheel.direction == 0.0f) continue;
    if (wheel.channel < 0 || !wheel.side || wheel.direction == 0.0f) {
      return fail(place, "needs side and direction beside it");
    }
    const auto channel = static_cast<std::size_t>(wheel.channel);
    if (design_.sides[channel] != Side::kUnused) return fail(place, "drives another wheel already");
    design_.sides[channel] = *wheel.side;
    design_.directions[channel] = wheel.direction;
    left = left || *wheel.side == Side::kLeft;
    right = right || *wheel.side == Side::kRight;
  }
  if (!left || !right) fail({"", -1, "wheels"}, "has none on the left or on the right");
}

// Notes that a key has been read. Returns false, and refuses the design, if it was read before.
bool CarDesignReader::first(const DesignPlace& place, Key key) {
  bool& found = found_[static_cast<std::size_t>(key)];
  if (found) fail(place, "stands there twice");
  found = true;
  return problem_[0] == '\0';
}

// Sets the parameters: the design's defaults, then stored values, then, fixed, what follows from the design itself.
// Returns how many stored values were refused.
std::size_t configure(Parameters& parameters, const DesignResult& design, Storage& storage) {
  const bool known = design.source == DesignSource::kFile;
  if (known) {
    for (std::size_t i = 0; i < kParameterCount; ++i) {
      if (design.design.defaults[i]) parameters.set(static_cast<Parameter>(i), *design.design.defaults[i]);
    }
  }
  const std::size_t refused_count = parameters.load(storage);
  if (!known) return refused_count;
  parameters.fix(Parameter::kWheelRadiusM, design.design.wheel_radius_m);
  parameters.fix(Parameter::kTrackM, design.design.track_m);
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
    const Side side = design.design.sides[channel];
    parameters.fix(channel_parameter(channel, ChannelParameter::kSide), static_cast<float>(side));
    if (side == Side::kUnused) continue;
    parameters.fix(channel_parameter(channel, ChannelParameter::kDirection), design.design.directions[channel]);
  }
  return refused_count;
}

}  // namespace foldcar
