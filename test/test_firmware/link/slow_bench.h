// A car whose flash is slow, as a board's is: models of its times, and a bench that measures what the ticks notice.
#pragma once

#include "../../suite.h"

#include <random>
#include <string>

#include "link_bench.h"

namespace foldcar {

// A model of the board's flash. Programming a page takes 3 ms, the most of W25Q32JV's data sheet (0.4 ms are typical);
// erasing one of a slot's 64 blocks 45 ms, one in ten 400 ms, the data sheet's typical value and its most. Reading takes 1 ms,
// an assumption. Whoever does it loses that time on the clock.
struct SlowLogs : SimLogs {
  explicit SlowLogs(SimClock& clock) : clock_(clock) { fitted = true; }

  double slowness = 1.0;           // factor on all times
  std::size_t capacity = kLogSize; // bytes of a log
  bool close_fails = false;
  int write_count = 0;             // programmed and erased
  int erase_count = 0;

  bool prepare() override {
    if (!fitted || unprepared_blocks_ == 0) return false;
    --unprepared_blocks_;
    take(++erase_count % 10 == 0 ? 400.0 : 45.0);
    ++write_count;
    SimLogs::prepare();
    return true;
  }
  std::uint16_t create() override {
    if (unprepared_blocks_ > 0) return 0;
    unprepared_blocks_ = kBlocks;
    return SimLogs::create();
  }
  bool append(const std::uint8_t* data, std::size_t size) override {
    return program() && logs[logs.rbegin()->first].size() + size <= capacity && SimLogs::append(data, size);
  }
  bool close() override { return program() && SimLogs::close() && !close_fails; }
  bool remove(std::uint16_t id) override { return program() && SimLogs::remove(id); }
  std::size_t size(std::uint16_t id) override {
    take(1.0);
    return SimLogs::size(id);
  }
  std::size_t read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) override {
    take(1.0);
    return SimLogs::read(id, offset, data, size);
  }

 private:
  static constexpr int kBlocks = 64;

  void take(double ms) { clock_.time_us += static_cast<std::uint64_t>(1000.0 * slowness * ms); }
  bool program() {
    ++write_count;
    take(3.0);
    return true;
  }

  SimClock& clock_;
  int unprepared_blocks_ = kBlocks;
};

// Saving a number takes 5 ms, one in ten 100 ms.
struct SlowStorage : SimStorage {
  explicit SlowStorage(SimClock& clock) : clock_(clock) {}

  double slowness = 1.0;  // factor on all times
  int save_count = 0;

  bool save(const char* name, float value) override {
    const double ms = ++save_count % 10 == 0 ? 100.0 : 5.0;
    clock_.time_us += static_cast<std::uint64_t>(1000.0 * slowness * ms);
    return SimStorage::save(name, value);
  }

 private:
  SimClock& clock_;
};

struct SlowBench {
  RecordingHal board;
  SlowLogs logs{board.clock};
  SlowStorage storage{board.clock};
  Firmware firmware{Hal{board.clock,  board.servos, board.battery, board.servo_battery,
                        board.link,   storage,      board.imu,     logs,
                        board.board},
                    kBuild};
  MavlinkHost host;
  bool flash_stops_both_cores = true;  // as on the ESP32; else the task that writes is alone in waiting
  std::uint64_t writer_free_us = 0;       // when the task that stores the log has time again
  std::mt19937 random{1};
  float noise = 1.0f;  // factor on what the IMU measures
  int erased_while_driving = 0, programmed_while_driving = 0;
  std::uint64_t ticked_us = 0;                     // when the last tick was
  std::uint64_t longest_gap_while_driving_us = 0;  // between two ticks

  // flash_is_ready: for the first log.
  explicit SlowBench(bool flash_is_ready = true) {
    board.link.room = 100000;
    board.imu.fitted = true;
    firmware.begin({});
    while (flash_is_ready && firmware.store_log()) {
    }
    run(20);
  }
  // As LinkBench::run, every millisecond and with a sign of life five times a second; the log is stored by another task.
  void run(std::uint64_t time_ms, const std::string& bytes = "") {
    board.link.incoming += bytes;
    const std::uint64_t end_us = board.clock.time_us + 1000 * time_ms;
    for (std::uint64_t polls = 0; board.clock.time_us < end_us; ++polls) {
      if (polls % 200 == 0) board.link.incoming += host.heartbeat();
      board.clock.time_us += 1000;
      if (polls % 20 == 0) shake();
      const std::size_t writes = board.servos.writes.size();
      const bool was_driving = firmware.application().is_driving();
      firmware.poll();
      if (board.servos.writes.size() > writes) note_tick(was_driving);
      if (board.clock.time_us >= writer_free_us) store_log();
    }
    host.receive(board.link.outgoing);
    board.link.outgoing.clear();
    board.servos.writes.clear();
  }
  // What an IMU measures on a moving car.
  void shake() {
    std::normal_distribution<float> acceleration(0.0f, 0.5f * noise), rate(0.0f, 0.05f * noise);
    board.imu.now.acceleration_m_s2 = {acceleration(random), acceleration(random), 9.81f + acceleration(random)};
    board.imu.now.rate_rad_s = {rate(random), rate(random), rate(random)};
  }
  // Every tick writes pulses, as does a stop.
  void note_tick(bool was_driving) {
    const std::uint64_t gap_us = board.clock.time_us - ticked_us;
    ticked_us = board.clock.time_us;
    if (was_driving && gap_us > longest_gap_while_driving_us) longest_gap_while_driving_us = gap_us;
  }
  void store_log() {
    const std::uint64_t before_us = board.clock.time_us;
    const int writes = logs.write_count, erased = logs.erase_count;
    firmware.store_log();
    if (firmware.application().is_driving()) {
      erased_while_driving += logs.erase_count - erased;
      programmed_while_driving += logs.write_count - writes;
    }
    writer_free_us = board.clock.time_us;
    if (!flash_stops_both_cores) board.clock.time_us = before_us;
  }
  // An untethered trial of that length (s), driven to its end.
  void drive(float time_s) {
    run(20, host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
    run(20, host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, time_s, 1, 8}));
    TEST_ASSERT_TRUE(firmware.application().is_driving());
    while (firmware.application().is_driving()) run(20);
    TEST_ASSERT_TRUE(firmware.application().trial_end() == TrialEnd::kTimeLimit);
  }
  MAV_RESULT answer(std::uint16_t command, const std::vector<float>& values) {
    run(20, host.command(command, values));
    return static_cast<MAV_RESULT>(host.acks().back().result);
  }
  mavlink_foldcar_trial_t told() {
    run(200);
    return host.trials().back();
  }
  // What the car says once the log is closed.
  mavlink_foldcar_trial_t closed() {
    mavlink_foldcar_trial_t trial = told();
    while (trial.log == FOLDCAR_LOG_OPEN) trial = told();
    return trial;
  }
  mavlink_foldcar_loop_t loop() {
    run(1100);
    return host.all<mavlink_foldcar_loop_t>(MAVLINK_MSG_ID_FOLDCAR_LOOP, mavlink_msg_foldcar_loop_decode).back();
  }
};

}  // namespace foldcar
