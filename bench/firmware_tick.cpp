// How long one tick of the whole firmware takes on this machine: a trial that runs, a host that shows life, telemetry
// and a log being written. Prints the mean and the slowest of many repetitions' means.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>

#include "../test/mavlink_host.h"
#include "../test/recording_hal.h"
#include "firmware.h"

using namespace foldcar;

int main() {
  constexpr int kRepetitions = 20, kTicks = 5000;
  RecordingHal board;
  board.link.room = 100000;
  board.imu.fitted = true;
  board.imu.now.acceleration_m_s2 = {0.0f, 0.0f, 9.81f};
  Firmware firmware(board.hal(), "0123456789abcdef");
  firmware.begin({});
  MavlinkHost host;
  const auto run = [&](int ticks) {
    for (int tick = 0; tick < ticks; ++tick) {
      if (tick % 10 == 0) board.link.incoming += host.heartbeat();
      board.clock.time_us += kTickUs;
      firmware.poll();
      firmware.store_log();
      board.link.outgoing.clear();
      board.servos.writes.clear();
    }
  };
  // One after the other: each is answered before the next is asked for.
  for (const std::string& request : {host.set_parameter("TRIAL_MAX_S", 3600), host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}),
                                     host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0.1f, 3600, 1, 1})}) {
    board.link.incoming += request;
    run(100);
  }
  double mean_us = 0, slowest_us = 0;
  for (int repetition = 0; repetition < kRepetitions; ++repetition) {
    const auto start = std::chrono::steady_clock::now();
    run(kTicks);
    const std::chrono::duration<double, std::micro> elapsed = std::chrono::steady_clock::now() - start;
    mean_us += elapsed.count() / kTicks / kRepetitions;
    slowest_us = std::max(slowest_us, elapsed.count() / kTicks);
  }
  const bool ran = firmware.application().is_driving();
  const char* problem = ran ? "" : ", BUT NO TRIAL RAN";
  std::printf("one tick of the firmware: %.2f us, at worst %.2f us%s\n", mean_us, slowest_us, problem);
  return ran ? 0 : 1;
}
