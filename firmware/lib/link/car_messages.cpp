#include "car_messages.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iterator>

namespace foldcar {
namespace {

std::uint32_t boot_ms(const CarView& car) { return static_cast<std::uint32_t>(car.hal.clock.now_us() / 1000); }

std::int16_t to_int16(float value) {
  return static_cast<std::int16_t>(std::clamp(std::round(value), -32768.0f, 32767.0f));
}

// custom_mode holds the state. The flag MAV_MODE_FLAG_CUSTOM_MODE_ENABLED is not set: with it ground stations would
// take the state for an ArduPilot rover's mode of the same number.
mavlink_heartbeat_t heartbeat(const CarView& car) {
  const Status status = car.application.status();
  mavlink_heartbeat_t content{};
  content.type = MAV_TYPE_GROUND_ROVER;
  content.autopilot = MAV_AUTOPILOT_GENERIC;
  const bool armed = car.application.is_armed();
  if (armed) content.base_mode |= MAV_MODE_FLAG_SAFETY_ARMED;
  if (status.state == State::kManual) content.base_mode |= MAV_MODE_FLAG_MANUAL_INPUT_ENABLED;
  if (status.state == State::kTesting) content.base_mode |= MAV_MODE_FLAG_TEST_ENABLED;
  content.custom_mode = static_cast<std::uint32_t>(status.state);
  content.system_status = armed ? MAV_STATE_ACTIVE : MAV_STATE_STANDBY;
  if (status.state == State::kFault) content.system_status = MAV_STATE_CRITICAL;
  content.mavlink_version = 3;
  return content;
}

mavlink_servo_output_raw_t servo_output(const CarView& car) {
  const PulsesUs pulses_us = car.application.status().pulses_us;
  mavlink_servo_output_raw_t content{};
  const auto raw = [&pulses_us](std::size_t i) { return static_cast<std::uint16_t>(std::lround(pulses_us[i])); };
  static_assert(kChannelCount == 8, "a field for each output");
  content.time_usec = static_cast<std::uint32_t>(car.hal.clock.now_us());
  content.servo1_raw = raw(0);
  content.servo2_raw = raw(1);
  content.servo3_raw = raw(2);
  content.servo4_raw = raw(3);
  content.servo5_raw = raw(4);
  content.servo6_raw = raw(5);
  content.servo7_raw = raw(6);
  content.servo8_raw = raw(7);
  return content;
}

mavlink_foldcar_trial_t trial(const CarView& car) {
  const Status status = car.application.status();
  const TrialRequest& request = car.application.trial();
  mavlink_foldcar_trial_t content{};
  content.time_boot_ms = boot_ms(car);
  content.trial_id = request.id;
  content.elapsed_ms = static_cast<std::uint32_t>(status.trial_elapsed_us / 1000);
  content.time_limit_ms = static_cast<std::uint32_t>(std::lround(1000.0f * request.time_limit_s));
  content.speed = request.speed_m_s;
  content.yaw_rate = request.yaw_rate_rad_s;
  content.state = static_cast<std::uint8_t>(status.state);
  content.end = static_cast<std::uint8_t>(car.application.trial_end());
  content.fault = static_cast<std::uint8_t>(status.fault);
  content.flags = static_cast<std::uint8_t>((request.untethered ? FOLDCAR_TRIAL_FLAGS_UNTETHERED : 0) |
                                            (request.waits_for_button ? FOLDCAR_TRIAL_FLAGS_BUTTON : 0));
  content.countdown_ms = static_cast<std::uint32_t>(status.countdown_us / 1000);
  content.log = static_cast<std::uint8_t>(car.log.state);
  content.log_lost = car.log.lost_bytes;
  return content;
}

// Which sensors are fitted and healthy, the processor's load (1000: a whole tick) and the battery (mV). UINT16_MAX and
// -1: not measured.
mavlink_sys_status_t system_status(const CarView& car) {
  const float battery_v = car.application.status().battery_v;
  const Fault fault = car.application.status().fault;
  mavlink_sys_status_t content{};
  constexpr std::uint32_t kImu = MAV_SYS_STATUS_SENSOR_3D_GYRO | MAV_SYS_STATUS_SENSOR_3D_ACCEL;
  std::uint32_t present = MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS | MAV_SYS_STATUS_SENSOR_BATTERY;
  if (car.hal.imu.present()) present |= kImu;
  if (car.hal.logs.present()) present |= MAV_SYS_STATUS_LOGGING;
  content.onboard_control_sensors_present = present;
  content.onboard_control_sensors_enabled = present;
  if (!car.application.servos_answer()) present &= ~MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS;
  if (std::isnan(battery_v)) present &= ~MAV_SYS_STATUS_SENSOR_BATTERY;
  if (fault == Fault::kImu) present &= ~kImu;
  content.onboard_control_sensors_health = present;
  content.load = static_cast<std::uint16_t>(std::min<std::uint32_t>(1000, car.loop.last_us / (kTickUs / 1000)));
  content.voltage_battery =
      std::isnan(battery_v) ? UINT16_MAX : static_cast<std::uint16_t>(std::clamp(1000.0f * battery_v, 0.0f, 65534.0f));
  content.current_battery = -1;
  content.battery_remaining = -1;
  content.errors_comm = static_cast<std::uint16_t>(std::min<std::uint32_t>(car.link.bad_count, UINT16_MAX));
  return content;
}

// MAVLink's axes are x forward, y right, z down: y and z change sign.
mavlink_attitude_t attitude(const CarView& car) {
  const Attitude& attitude = car.application.attitude();
  const ImuSample& sample = car.application.imu_sample();
  mavlink_attitude_t content{};
  content.time_boot_ms = boot_ms(car);
  content.roll = roll_rad(attitude);
  content.pitch = pitch_rad(attitude);
  content.yaw = -attitude.yaw_rad;
  content.rollspeed = sample.rate_rad_s[0];
  content.pitchspeed = -sample.rate_rad_s[1];
  content.yawspeed = -sample.rate_rad_s[2];
  return content;
}

mavlink_scaled_imu_t scaled_imu(const CarView& car) {
  constexpr float kMilliGInMS2 = 0.00980665f;
  const ImuSample& sample = car.application.imu_sample();
  mavlink_scaled_imu_t content{};
  content.time_boot_ms = boot_ms(car);
  content.xacc = to_int16(sample.acceleration_m_s2[0] / kMilliGInMS2);
  content.yacc = to_int16(-sample.acceleration_m_s2[1] / kMilliGInMS2);
  content.zacc = to_int16(-sample.acceleration_m_s2[2] / kMilliGInMS2);
  content.xgyro = to_int16(1000.0f * sample.rate_rad_s[0]);
  content.ygyro = to_int16(-1000.0f * sample.rate_rad_s[1]);
  content.zgyro = to_int16(-1000.0f * sample.rate_rad_s[2]);
  return content;
}

mavlink_foldcar_loop_t loop(const CarView& car) {
  mavlink_foldcar_loop_t content{};
  content.time_boot_ms = boot_ms(car);
  content.tick_count = car.loop.tick_count;
  content.missed_count = car.loop.missed_count;
  content.worst_us = car.loop.worst_us;
  content.last_us = car.loop.last_us;
  content.received_count = car.link.received_count;
  content.bad_count = car.link.bad_count;
  content.unsent_count = car.link.unsent_count;
  content.reset_reason = static_cast<std::uint8_t>(car.hal.board.reset_reason());
  return content;
}

// The board has a report: has_crash_report().
mavlink_foldcar_crash_t crash(const CarView& car) {
  const CrashReport& report = *car.hal.board.crash_report();
  mavlink_foldcar_crash_t content{};
  static_assert(sizeof content.address == sizeof report.addresses);
  std::memcpy(content.address, report.addresses, sizeof content.address);
  content.data_address = report.data_address;
  content.reset_reason = static_cast<std::uint8_t>(car.hal.board.reset_reason());
  content.cause = report.cause;
  return content;
}

mavlink_foldcar_design_t design(const CarView& car) {
  const DesignResult& design = car.application.design();
  const Parameters& parameters = car.application.parameters();
  mavlink_foldcar_design_t content{};
  content.wheel_radius = parameters.get(Parameter::kWheelRadiusM);
  content.track = parameters.get(Parameter::kTrackM);
  content.source = static_cast<std::uint8_t>(design.source);
  for (std::size_t i = 0; i < kChannelCount; ++i) {
    if (parameters.get(i, ChannelParameter::kSide) != 0.0f) ++content.wheel_count;
  }
  content.hardware = car.hal.board.is_simulated() ? FOLDCAR_HARDWARE_SIMULATED : FOLDCAR_HARDWARE_BOARD;
  std::memcpy(content.name, design.design.name, sizeof content.name);
  std::memcpy(content.hash, design.design.hash, sizeof content.hash);
  std::memcpy(content.build, car.build, std::min(std::strlen(car.build), sizeof content.build));
  return content;
}

// Converts 16 hexadecimal digits to eight bytes. Leaves `bytes` as they are if there are fewer digits.
void to_bytes(const char* digits, std::uint8_t (&bytes)[8]) {
  for (std::size_t i = 0; i < sizeof bytes && std::strlen(digits) >= 2 * sizeof bytes; ++i) {
    const char pair[] = {digits[2 * i], digits[2 * i + 1], '\0'};
    bytes[i] = static_cast<std::uint8_t>(std::strtoul(pair, nullptr, 16));
  }
}

mavlink_autopilot_version_t version(const CarView& car) {
  mavlink_autopilot_version_t content{};
  content.capabilities = MAV_PROTOCOL_CAPABILITY_MAVLINK2 | MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST;
  to_bytes(car.build, content.flight_custom_version);
  to_bytes(car.application.design().design.hash, content.middleware_custom_version);
  return content;
}

mavlink_system_time_t system_time(const CarView& car) {
  mavlink_system_time_t content{};
  content.time_boot_ms = boot_ms(car);
  return content;
}

// Fills `message` with kContent(car), encoded by MAVLink's generated function kEncode, as sent by the car's component;
// pack_own likewise for foldcar's own messages.
template <auto kEncode, auto kContent>
void pack(const CarView& car, PacketNumbers& numbers, mavlink_message_t& message) {
  const auto content = kContent(car);
  kEncode(kCarSystem, kCarComponent, &numbers.car, &message, &content);
}

template <auto kEncode, auto kContent>
void pack_own(const CarView& car, PacketNumbers& numbers, mavlink_message_t& message) {
  const auto content = kContent(car);
  kEncode(kCarSystem, kOwnComponent, &numbers.own, &message, &content);
}

// The servo battery's voltage as that of one cell. Packed from separate arrays, not from MAVLink's struct: in this one
// the last array stands at an odd address, which the ESP32 cannot read as words.
void pack_servo_battery(const CarView& car, PacketNumbers& numbers, mavlink_message_t& message) {
  constexpr std::uint16_t kNone = UINT16_MAX;
  const float millivolts = std::clamp(1000.0f * car.application.status().servo_battery_v, 0.0f, 65534.0f);
  const std::uint16_t cells_mv[10] = {static_cast<std::uint16_t>(std::lround(millivolts)),
                                      kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone};
  const std::uint16_t more_cells_mv[4] = {};
  mavlink_msg_battery_status_pack_status(kCarSystem, kCarComponent, &numbers.car, &message, FOLDCAR_BATTERY_SERVOS,
                                         MAV_BATTERY_FUNCTION_PROPULSION, MAV_BATTERY_TYPE_UNKNOWN, INT16_MAX, cells_mv,
                                         -1, -1, -1, -1, 0, MAV_BATTERY_CHARGE_STATE_UNDEFINED, more_cells_mv,
                                         MAV_BATTERY_MODE_UNKNOWN, 0);
}

bool always(const CarView&) { return true; }
bool has_imu(const CarView& car) { return car.hal.imu.present(); }
bool has_crash_report(const CarView& car) { return car.hal.board.crash_report() != nullptr; }
bool measures_servo_battery(const CarView& car) { return !std::isnan(car.application.status().servo_battery_v); }

struct Row {
  MessageInfo info;
  bool (*is_available)(const CarView&);
  void (*pack)(const CarView&, PacketNumbers&, mavlink_message_t&);
};

// In the order in which they are sent: the trial's state comes before the pulses of the same tick. docs/link.md has
// this table too.
constexpr Row kRows[] = {
    {{MAVLINK_MSG_ID_HEARTBEAT, 1000000}, always, pack<mavlink_msg_heartbeat_encode_status, heartbeat>},
    {{MAVLINK_MSG_ID_FOLDCAR_TRIAL, 100000}, always, pack_own<mavlink_msg_foldcar_trial_encode_status, trial>},
    {{MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, 20000},
     always,
     pack<mavlink_msg_servo_output_raw_encode_status, servo_output>},
    {{MAVLINK_MSG_ID_SYS_STATUS, 500000}, always, pack<mavlink_msg_sys_status_encode_status, system_status>},
    {{MAVLINK_MSG_ID_BATTERY_STATUS, 500000}, measures_servo_battery, pack_servo_battery},
    {{MAVLINK_MSG_ID_ATTITUDE, 100000}, has_imu, pack<mavlink_msg_attitude_encode_status, attitude>},
    {{MAVLINK_MSG_ID_SCALED_IMU, 100000}, has_imu, pack<mavlink_msg_scaled_imu_encode_status, scaled_imu>},
    {{MAVLINK_MSG_ID_SYSTEM_TIME, 1000000}, always, pack<mavlink_msg_system_time_encode_status, system_time>},
    {{MAVLINK_MSG_ID_FOLDCAR_LOOP, 1000000}, always, pack_own<mavlink_msg_foldcar_loop_encode_status, loop>},
    {{MAVLINK_MSG_ID_FOLDCAR_CRASH, -1}, has_crash_report, pack_own<mavlink_msg_foldcar_crash_encode_status, crash>},
    {{MAVLINK_MSG_ID_FOLDCAR_DESIGN, -1}, always, pack_own<mavlink_msg_foldcar_design_encode_status, design>},
    {{MAVLINK_MSG_ID_AUTOPILOT_VERSION, -1}, always, pack<mavlink_msg_autopilot_version_encode_status, version>},
};
static_assert(std::size(kRows) <= kMaxMessageCount, "raise kMaxMessageCount");

}  // namespace

std::size_t message_count() { return std::size(kRows); }

const MessageInfo& message_info(std::size_t index) { return kRows[index].info; }

std::size_t find_message(std::uint32_t message_id) {
  std::size_t index = 0;
  while (index < std::size(kRows) && kRows[index].info.id != message_id) ++index;
  return index;
}

bool compose(std::uint32_t message_id, const CarView& car, PacketNumbers& numbers, mavlink_message_t& message) {
  const std::size_t index = find_message(message_id);
  if (index == std::size(kRows) || !kRows[index].is_available(car)) return false;
  kRows[index].pack(car, numbers, message);
  return true;
}

}  // namespace foldcar
