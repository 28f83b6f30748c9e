// The firmware on a recording HAL, and a host, connected by a cable that loses nothing.
#pragma once

#include <unity.h>

#include <cstdint>
#include <string>
#include <vector>

#include "../../mavlink_host.h"
#include "../../recording_hal.h"
#include "firmware.h"

namespace foldcar {

constexpr const char* kBuild = "00112233445566ff";
constexpr PulsesUs kOff{};

struct LinkBench {
  RecordingHal board;
  Firmware firmware{board.hal(), kBuild};
  MavlinkHost host;

  explicit LinkBench(const DesignResult& design = {}) {
    board.link.room = 100000;
    firmware.begin(design);
    firmware.store_log();
  }
  // Gives the car the host's bytes, polls the firmware every 4 ms for time_ms, and gives the host the car's.
  void run(std::uint64_t time_ms, const std::string& bytes = "") {
    board.link.incoming += bytes;
    for (std::uint64_t t_ms = 0; t_ms < time_ms; t_ms += 4) {
      board.clock.time_us += 4000;
      firmware.poll();
      firmware.store_log();
    }
    host.receive(board.link.outgoing);
    board.link.outgoing.clear();
  }
  // Sends a heartbeat, so that the host is known, and a command; returns the acknowledgement.
  mavlink_command_ack_t answer(std::uint16_t command, const std::vector<float>& parameters,
                               std::uint8_t confirmation = 0) {
    const std::size_t before = host.acks().size();
    run(20, host.heartbeat() + host.command(command, parameters, confirmation));
    TEST_ASSERT_EQUAL_UINT_MESSAGE(before + 1, host.acks().size(), "one answer to a command");
    return host.acks().back();
  }
  void expect(MAV_RESULT result, Refusal refusal, std::uint16_t command, const std::vector<float>& parameters) {
    const mavlink_command_ack_t ack = answer(command, parameters);
    TEST_ASSERT_EQUAL_UINT(command, ack.command);
    TEST_ASSERT_EQUAL_UINT(result, ack.result);
    TEST_ASSERT_EQUAL_INT(static_cast<int>(refusal), ack.result_param2);
    TEST_ASSERT_EQUAL_UINT(255, ack.target_system);
  }
  // Arms the car and starts a trial.
  mavlink_command_ack_t start(const std::vector<float>& trial) {
    answer(MAV_CMD_COMPONENT_ARM_DISARM, {1});
    return answer(MAV_CMD_FOLDCAR_START_TRIAL, trial);
  }
  Refusal last_refusal() const { return static_cast<Refusal>(host.acks().back().result_param2); }
  std::string last_text() const { return host.texts().back(); }
  Fault fault() const { return firmware.application().status().fault; }
  State state() const { return firmware.application().status().state; }
  const PulsesUs& last_us() const { return board.servos.writes.back(); }
};

inline std::size_t count_of(const MavlinkHost& host, std::uint32_t message_id) {
  std::size_t count = 0;
  for (const mavlink_message_t& message : host.received) count += message.msgid == message_id ? 1 : 0;
  return count;
}

inline const std::vector<float> kStart = {0.3f, 0.0f, 20.0f, 0.0f, 7.0f};
inline const std::vector<float> kStartUntethered = {0.3f, 0.0f, 20.0f, 1.0f, 8.0f};

}  // namespace foldcar
