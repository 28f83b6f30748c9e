// The HAL of a simulated car: its time is set by the stepper, its sensors by the simulated world, and tests make its parts
// fail. One object for each car; nothing is shared between cars.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "hal.h"

namespace foldcar {

struct SimClock : Clock {
  std::uint64_t time_us = 0;
  std::uint64_t now_us() const override { return time_us; }
  void advance_to_us(std::uint64_t t_us) { time_us = t_us; }
};

// Holds the last pulses that it took.
class SimServos : public WheelServos {
 public:
  bool write_pulses(const PulsesUs& pulses_us) override;
  const PulsesUs& pulses_us() const { return pulses_us_; }
  // While false the bus acknowledges no write, and the driver continues with its last pulses.
  bool answers = true;

 private:
  PulsesUs pulses_us_{};
};

// The cell that supplies the board; the servos do not load it, so its voltage (V) is what it is set to.
struct SimBattery : Battery {
  explicit SimBattery(float volts_v = 4.0f) : volts(volts_v) {}
  float volts;
  float voltage_v() override { return volts; }
};

// The cable: the firmware reads to_car and writes from_car.
struct SimLink : ByteLink {
  std::vector<std::uint8_t> to_car;
  std::vector<std::uint8_t> from_car;
  std::size_t read(std::uint8_t* data, std::size_t size) override;
  std::size_t write(const std::uint8_t* data, std::size_t size) override;
};

// Flash memory that lives as long as the object; while accepts is false it stores nothing, without fitted it has nothing.
struct SimStorage : Storage {
  std::map<std::string, float> values;
  bool accepts = true;
  bool fitted = true;
  bool present() const override { return fitted; }
  bool load(const char* name, float& value) override;
  bool save(const char* name, float value) override;
  bool clear() override;
};

// Gives the sample that the simulated world has set. Most cars have none.
struct SimImu : Imu {
  bool fitted = false;
  bool answers = true;
  ImuSample now;
  bool present() const override { return fitted; }
  bool read(ImuSample& sample) override;
};

// Logs that live as long as the object; while accepts is false none is created or extended.
struct SimLogs : LogStorage {
  bool fitted = false;
  bool accepts = true;
  std::map<std::uint16_t, std::string> logs;
  bool present() const override { return fitted; }
  bool prepare() override;
  std::uint16_t create() override;
  bool append(const std::uint8_t* data, std::size_t size) override;
  bool close() override;
  std::size_t size(std::uint16_t id) override;
  std::size_t read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) override;
  bool remove(std::uint16_t id) override;
  LogRange range() const override;

 private:
  std::uint16_t open_ = 0;  // number of the open log, 0 for none
};

struct SimBoard : Board {
  ResetReason reason = ResetReason::kPowerOn;
  std::optional<CrashReport> crash;
  bool restart_is_requested = false;
  bool led_is_on = false;
  bool button = false;
  ResetReason reset_reason() const override { return reason; }
  const CrashReport* crash_report() const override { return crash ? &*crash : nullptr; }
  void restart() override { restart_is_requested = true; }
  void set_led(bool on) override { led_is_on = on; }
  bool button_is_pressed() override { return button; }
  bool is_simulated() const override { return true; }
};

// All parts together. Tests put servos and a link in their place that record what is written to them.
template <class Servos, class Link>
struct BasicSimHal {
  BasicSimHal() = default;
  // battery_v: voltage of the logic's cell (V).
  explicit BasicSimHal(double battery_v) { battery.volts = static_cast<float>(battery_v); }

  SimClock clock;
  Servos servos;
  SimBattery battery;
  SimBattery servo_battery{std::numeric_limits<float>::quiet_NaN()};  // most cars do not measure it
  Link link;
  SimStorage storage;
  SimImu imu;
  SimLogs logs;
  SimBoard board;

  Hal hal() { return {clock, servos, battery, servo_battery, link, storage, imu, logs, board}; }
};

using SimHal = BasicSimHal<SimServos, SimLink>;

}  // namespace foldcar
