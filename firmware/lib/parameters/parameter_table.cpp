#include "parameter_table.h"

#include <cstring>
#include <iterator>

namespace foldcar {
namespace {

template <class Index>
struct Row {
  Index index;
  ParameterInfo info;
};

constexpr ParameterKind kReal = ParameterKind::kReal;
constexpr ParameterKind kInteger = ParameterKind::kInteger;
constexpr ParameterKind kSign = ParameterKind::kSign;

// The defaults describe the width study's car: four wheels with FS90R servos, whose four NiMH cells are empty at 0.9 V each
// (IEC 61951-2, discharged within an hour).
constexpr Row<Parameter> kCarRows[] = {
    {Parameter::kWheelRadiusM,
     {"WHEEL_RADIUS_M", "m", 0.005f, 0.5f, 0.06f, kReal, "radius of the wheels"}},
    {Parameter::kTrackM,
     {"TRACK_M", "m", 0.01f, 2.0f, 0.111f, kReal, "distance between the middles of left and right tyres"}},
    {Parameter::kWheelMaxRadS,
     {"WHEEL_MAX_RAD_S", "rad/s", 0.1f, 100.0f, 11.5f, kReal,
      "fastest wheel speed asked of a servo; a faster set-point is scaled back, its curve kept"}},
    {Parameter::kSlewUsPerS,
     {"SLEW_US_PER_S", "us/s", 10.0f, 100000.0f, 1000.0f, kReal,
      "fastest change of a pulse outside the deadband"}},
    {Parameter::kStaggerMs,
     {"STAGGER_MS", "ms", 0.0f, 1000.0f, 40.0f, kReal, "delay between the starts of one axle and the next"}},
    {Parameter::kBattMinV,
     {"BATT_MIN_V", "V", 0.0f, 15.0f, 3.4f, kReal, "lowest battery voltage to drive with; 0 allows any"}},
    {Parameter::kServoMinV,
     {"SERVO_MIN_V", "V", 0.0f, 15.0f, 3.6f, kReal,
      "lowest voltage of the servos' battery to drive with, if SERVO_DIVIDER says that it is measured; 0 allows any"}},
    {Parameter::kBattLowMs,
     {"BATT_LOW_MS", "ms", 0.0f, 60000.0f, 500.0f, kReal,
      "how long a battery may be below BATT_MIN_V or SERVO_MIN_V"}},
    {Parameter::kCmdTimeoutMs,
     {"CMD_TIMEOUT_MS", "ms", 50.0f, 10000.0f, 450.0f, kReal,
      "longest silence of a host that drives; a tick later, at 470 ms, the pulses are off"}},
    {Parameter::kArmTimeoutS,
     {"ARM_TIMEOUT_S", "s", 1.0f, 120.0f, 5.0f, kReal,
      "longest silence of the host that armed the car; then it disarms"}},
    {Parameter::kTrialMaxS,
     {"TRIAL_MAX_S", "s", 1.0f, 3600.0f, 600.0f, kReal, "longest trial that may be asked for"}},
    {Parameter::kTiltMaxRad,
     {"TILT_MAX_RAD", "rad", 0.1f, 3.2f, 1.05f, kReal, "largest tilt to drive with, if there is an IMU; 3.2 allows any"}},
    {Parameter::kTiltMs,
     {"TILT_MS", "ms", 0.0f, 60000.0f, 300.0f, kReal, "how long the car may be tilted beyond TILT_MAX_RAD"}},
    {Parameter::kPwmOscHz,
     {"PWM_OSC_HZ", "Hz", 23e6f, 27e6f, 25e6f, kReal,
      "true frequency of the servo driver's oscillator; read when the board starts"}},
    {Parameter::kOeWired,
     {"OE_WIRED", "", 0.0f, 1.0f, 0.0f, kInteger,
      "1 if the servo driver's output enable is wired to GPIO27; read when the board starts"}},
    {Parameter::kButtonWired,
     {"BUTTON_WIRED", "", 0.0f, 1.0f, 0.0f, kInteger,
      "1 if a button connects GPIO32 to ground; read when the board starts"}},
    {Parameter::kServoDivider,
     {"SERVO_DIVIDER", "", 0.0f, 10.0f, 0.0f, kReal,
      "voltage of the servos' battery divided by that at GPIO34, 3 with 20 and 10 kOhm; 0 if it is not wired; "
      "read when the board starts"}},
};

constexpr Row<ChannelParameter> kChannelRows[] = {
    {ChannelParameter::kSide,
     {"SIDE", "", 0.0f, 2.0f, 0.0f, kInteger, "0 unused, 1 left wheel, 2 right wheel"}},
    {ChannelParameter::kDirection,
     {"DIRECTION", "", -1.0f, 1.0f, 1.0f, kSign, "1 if a longer pulse drives the car forward, else -1"}},
    {ChannelParameter::kReversed,
     {"REVERSED", "", 0.0f, 1.0f, 0.0f, kInteger, "1 if this servo turns the other way than DIRECTION says"}},
    {ChannelParameter::kNeutralUs,
     {"NEUTRAL_US", "us", 1300.0f, 1700.0f, 1500.0f, kReal, "pulse at which the servo stands"}},
    {ChannelParameter::kDeadbandUs,
     {"DEADBAND_US", "us", 0.0f, 200.0f, 45.0f, kReal, "distance from neutral at which the servo starts"}},
    {ChannelParameter::kGainUs,
     {"GAIN_US", "us/(rad/s)", 0.0f, 500.0f, 155.0f / 11.5f, kReal,
      "pulse beyond the deadband for each rad/s of wheel speed"}},
};

static_assert(std::size(kCarRows) == kCarParameterCount, "one row for each Parameter");
static_assert(std::size(kChannelRows) == kParametersPerChannel, "one row for each ChannelParameter");

constexpr ParameterInfo channel_info(std::size_t channel, const Row<ChannelParameter>& row) {
  ParameterInfo info = row.info;
  const char prefix[] = {'C', 'H', static_cast<char>('1' + channel), '_'};
  for (char& letter : info.name) letter = '\0';
  for (std::size_t i = 0; i < std::size(prefix); ++i) info.name[i] = prefix[i];
  for (std::size_t i = 0; row.info.name[i] != '\0'; ++i) info.name[std::size(prefix) + i] = row.info.name[i];

  // CH1 and CH3 are left, CH2 and CH4 right, the front axle first; the servos of the right side are mounted mirrored.
  const bool left = channel % 2 == 0;
  const Side side = channel >= 4 ? Side::kUnused : left ? Side::kLeft : Side::kRight;
  if (row.index == ChannelParameter::kSide) info.default_value = static_cast<float>(side);
  if (row.index == ChannelParameter::kDirection) info.default_value = left ? 1.0f : -1.0f;
  return info;
}

constexpr std::array<ParameterInfo, kParameterCount> build_table() {
  std::array<ParameterInfo, kParameterCount> table{};
  for (const auto& row : kCarRows) table[static_cast<std::size_t>(row.index)] = row.info;
  for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
    for (const auto& row : kChannelRows) {
      table[static_cast<std::size_t>(channel_parameter(channel, row.index))] = channel_info(channel, row);
    }
  }
  return table;
}

constexpr std::array<ParameterInfo, kParameterCount> kTable = build_table();

constexpr bool every_row_is_filled() {
  for (const ParameterInfo& info : kTable) {
    if (info.help == nullptr || !(info.minimum < info.maximum)) return false;
    if (info.default_value < info.minimum || info.default_value > info.maximum) return false;
  }
  return true;
}
static_assert(every_row_is_filled(), "an index has two rows or none, or a default is out of range");

}  // namespace

const std::array<ParameterInfo, kParameterCount>& parameter_table() { return kTable; }

const ParameterInfo& parameter_info(Parameter parameter) {
  return kTable[static_cast<std::size_t>(parameter)];
}

std::optional<Parameter> find_parameter(const char* name) {
  for (std::size_t i = 0; i < kTable.size(); ++i) {
    if (std::strcmp(kTable[i].name, name) == 0) return static_cast<Parameter>(i);
  }
  return std::nullopt;
}

}  // namespace foldcar
