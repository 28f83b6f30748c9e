// The car of `carsim link`, without its port: it drives when a host says so, shows every fault, and repeats its record.
#include "../../mavlink_host.h"
#include "../../study_car.h"
#include "link_record.h"
#include "linked_car.h"
#include "multibody_engine.h"

#include <sstream>
#include <string>
#include <vector>

// After the rest: Unity hides std::isnan behind a macro.
#include "../../suite.h"

using namespace foldcar;
using nlohmann::json;

namespace {

const char* const kFirmware = "0123456789abcdef";

// A car on a cable with a host that sends a heartbeat every 0.2 s, and the record of both.
struct Bench {
  MultibodyEngine engine;
  std::vector<LinkedWorld> worlds;
  std::ostringstream lines;
  LinkRecord record{lines};
  MavlinkHost host;
  LinkedCarOptions options;
  std::unique_ptr<LinkedCar> car;

  explicit Bench(bool put_back = false) {
    SceneSpec scene;
    scene.id = "flat";
    scene.friction = 0.6;
    scene.course = {-5, 5, -5, 5};
    worlds.push_back({study_car(0.095), scene});
    scene.id = "further on";
    scene.start.x_m = 2;
    worlds.push_back({study_car(0.115), scene});
    options.design.source = DesignSource::kNone;
    options.put_back = put_back;
    car = std::make_unique<LinkedCar>(engine, worlds, options, kFirmware);
  }
  void send(const std::string& packet) {
    const std::vector<std::uint8_t> bytes(packet.begin(), packet.end());
    record.to_car(car->now_us(), bytes, false);
    car->receive(bytes, false);
  }
  void inject(const char* line) {
    record.inject(car->now_us(), json::parse(line));
    car->inject(read_injection(json::parse(line)));
  }
  void run(double seconds) {
    const std::uint64_t end_us = car->now_us() + static_cast<std::uint64_t>(1e6 * seconds);
    for (int step = 0; car->now_us() < end_us; ++step) {
      if (step % 48 == 0) send(host.heartbeat());
      const std::vector<std::uint8_t> sent = car->step();
      record.from_car(car->now_us(), sent);
      host.receive({sent.begin(), sent.end()});
    }
  }
  void start_trial() {
    run(0.5);
    send(host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
    run(0.1);
    send(host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.5f, 0, 30, 0, 7}));
    run(1);
  }
  float x_m() const {
    return host.all<mavlink_foldcar_truth_t>(MAVLINK_MSG_ID_FOLDCAR_TRUTH, mavlink_msg_foldcar_truth_decode).back().x;
  }
  mavlink_foldcar_trial_t trial() const { return host.trials().back(); }
};

}  // namespace

TEST(test_a_trial_moves_the_car_and_its_truth_says_so) {
  Bench bench;
  bench.start_trial();
  TEST_ASSERT_EQUAL_INT(FOLDCAR_STATE_RUNNING, bench.trial().state);
  TEST_ASSERT_EQUAL_UINT(7, bench.trial().trial_id);
  TEST_ASSERT_TRUE(bench.x_m() > 0.2f && bench.x_m() < 0.6f);
  const auto scenes =
      bench.host.all<mavlink_foldcar_scene_t>(MAVLINK_MSG_ID_FOLDCAR_SCENE, mavlink_msg_foldcar_scene_decode);
  TEST_ASSERT_EQUAL_STRING("flat", scenes.front().id);
}

TEST(test_each_fault_stops_the_car_with_its_name) {
  const struct {
    const char* line;
    int fault;
  } kFaults[] = {
      {R"({"inject": "battery", "volts": 2.0})", FOLDCAR_FAULT_BATTERY_LOW},
      {R"({"inject": "battery_unreadable"})", FOLDCAR_FAULT_BATTERY_UNREADABLE},
      {R"({"inject": "bus_error"})", FOLDCAR_FAULT_BUS},
      {R"({"inject": "imu_error"})", FOLDCAR_FAULT_IMU},
      {R"({"inject": "brown_out"})", FOLDCAR_FAULT_BROWN_OUT},
      {R"({"inject": "watchdog"})", FOLDCAR_FAULT_WATCHDOG},
      {R"({"inject": "crash", "address": 1074597428})", FOLDCAR_FAULT_CRASH},
      {R"({"inject": "unplug", "for_s": 1})", FOLDCAR_FAULT_COMMAND_STALE},
      {R"({"inject": "drop", "share": 1, "for_s": 1})", FOLDCAR_FAULT_COMMAND_STALE},
      {R"({"inject": "corrupt", "share": 1, "for_s": 1})", FOLDCAR_FAULT_COMMAND_STALE},
  };
  for (const auto& fault : kFaults) {
    Bench bench;
    bench.start_trial();
    bench.inject(fault.line);
    bench.run(2);
    TEST_ASSERT_EQUAL_INT_MESSAGE(FOLDCAR_STATE_FAULT, bench.trial().state, fault.line);
    TEST_ASSERT_EQUAL_INT_MESSAGE(fault.fault, bench.trial().fault, fault.line);
  }
}

TEST(test_a_measured_servo_battery_that_is_low_stops_the_car) {
  for (const float divider : {3.0f, 0.0f}) {
    Bench bench;
    bench.options.stored_parameters = {{"SERVO_DIVIDER", divider}};
    bench.car = std::make_unique<LinkedCar>(bench.engine, bench.worlds, bench.options, kFirmware);
    bench.start_trial();
    bench.inject(R"({"inject": "servo_battery", "volts": 3.5, "for_s": 1})");
    bench.run(1.5);
    const int expected = divider > 0 ? FOLDCAR_FAULT_SERVO_BATTERY_LOW : FOLDCAR_FAULT_NONE;
    TEST_ASSERT_EQUAL_INT(expected, bench.trial().fault);
  }
}

TEST(test_a_battery_fault_ends_in_time) {
  Bench bench;
  bench.start_trial();
  bench.inject(R"({"inject": "battery", "volts": 2.0, "for_s": 0.1})");
  bench.run(1);
  TEST_ASSERT_EQUAL_INT(FOLDCAR_STATE_RUNNING, bench.trial().state);
}

TEST(test_the_car_can_be_put_back) {
  Bench by_hand;
  by_hand.start_trial();
  by_hand.inject(R"({"inject": "put_back"})");
  by_hand.run(0.02);
  TEST_ASSERT_FLOAT_WITHIN(0.02f, 0.0f, by_hand.x_m());
  Bench when_armed(true);
  when_armed.start_trial();
  when_armed.send(when_armed.host.command(MAV_CMD_FOLDCAR_STOP_TRIAL, {}));
  when_armed.run(1);
  TEST_ASSERT_TRUE(when_armed.x_m() > 0.2f);
  when_armed.send(when_armed.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  when_armed.run(0.2);
  TEST_ASSERT_FLOAT_WITHIN(0.02f, 0.0f, when_armed.x_m());
}

// A car that has driven up a wall onto its back, and is put back when it is armed for the next trial, or by hand.
TEST(test_a_car_that_has_tipped_drives_again_when_it_is_put_back) {
  for (const bool when_armed : {true, false}) {
    Bench bench(when_armed);
    bench.worlds[0].scene.terrain.blocks = {{0.6, 0, 0.3, 2, 0.2, 0, BlockSpec::Kind::kBox}};
    bench.car = std::make_unique<LinkedCar>(bench.engine, bench.worlds, bench.options, kFirmware);
    bench.start_trial();
    bench.run(2);
    TEST_ASSERT_EQUAL_INT(FOLDCAR_FAULT_TILT, bench.trial().fault);
    bench.send(bench.host.command(MAV_CMD_FOLDCAR_ACKNOWLEDGE_FAULT, {}));
    bench.run(0.1);
    if (!when_armed) bench.inject(R"({"inject": "put_back"})");
    bench.send(bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
    bench.run(0.02);
    bench.send(bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.3f, 0, 30, 0, 8}));
    bench.run(1);
    TEST_ASSERT_EQUAL_UINT(8, bench.trial().trial_id);
    TEST_ASSERT_EQUAL_INT(FOLDCAR_STATE_RUNNING, bench.trial().state);
    const auto attitude =
        bench.host.all<mavlink_attitude_t>(MAVLINK_MSG_ID_ATTITUDE, mavlink_msg_attitude_decode).back();
    TEST_ASSERT_FLOAT_WITHIN(0.05f, 0, attitude.pitch);
    TEST_ASSERT_FLOAT_WITHIN(0.05f, 0, attitude.roll);
  }
}

TEST(test_a_disarmed_car_follows_the_host_to_another_scene) {
  Bench bench(true);
  const auto scene = [&] {
    return bench.host.all<mavlink_foldcar_scene_t>(MAVLINK_MSG_ID_FOLDCAR_SCENE, mavlink_msg_foldcar_scene_decode).back();
  };
  bench.run(0.5);
  bench.send(bench.host.scene("further on"));
  bench.run(0.05);
  TEST_ASSERT_EQUAL_STRING("further on", scene().id);
  TEST_ASSERT_FLOAT_WITHIN(0.02f, 2.0f, bench.x_m());
  bench.start_trial();
  TEST_ASSERT_TRUE(bench.x_m() > 2.2f);
  // Not while it drives, and not to a scene that it does not have.
  bench.send(bench.host.scene("flat"));
  bench.run(0.05);
  TEST_ASSERT_EQUAL_STRING("further on", scene().id);
  TEST_ASSERT_TRUE(bench.x_m() > 2.2f);
  bench.send(bench.host.command(MAV_CMD_FOLDCAR_STOP_TRIAL, {}));
  bench.run(0.1);
  bench.send(bench.host.scene("elsewhere"));
  bench.run(0.05);
  TEST_ASSERT_EQUAL_STRING("further on", scene().id);
}

TEST(test_a_record_repeats_itself) {
  Bench bench;
  bench.send(bench.host.scene("further on"));
  bench.start_trial();
  bench.inject(R"({"inject": "corrupt", "share": 0.01, "for_s": 0.5})");
  bench.run(1);
  bench.record.end(bench.car->now_us());
  const std::string first = bench.lines.str();
  TEST_ASSERT_TRUE(first.find("from_car") != std::string::npos);
  LinkedCar again(bench.engine, bench.worlds, bench.options, kFirmware);
  std::istringstream lines(first);
  std::ostringstream second;
  LinkRecord record(second);
  replay(lines, again, record);
  TEST_ASSERT_TRUE(first == second.str());
}

TEST(test_a_wrong_record_is_refused_by_its_line) {
  const struct {
    const char* text;
    const char* words;
  } kRecords[] = {
      {"{\"t_us\": 9000, \"to_car\": \"00\"}\n{\"t_us\": 1, \"to_car\": \"00\"}\n", "line 2: line.t_us: 1 is before"},
      {"{\"t_us\": 0, \"to_car\": \"0g\"}\n", "line 1: line.to_car: is not bytes"},
      {"{\"t_us\": 0, \"to_car\": \"000\"}\n", "line 1: line.to_car: is not bytes"},
      {"{\"t_us\": 0, \"inject\": \"rain\"}\n", "line 1: line.inject: "},
      {"{\"t_us\": 0, \"inject\": \"drop\", \"share\": 2}\n", "line 1: line.share: 2.0 is above the limit 1"},
      {"{\"t_us\": 0, \"to_car_late\": \"00\"}\n", "the record has no end"},
  };
  for (const auto& wrong : kRecords) {
    Bench bench;
    std::istringstream lines(wrong.text);
    std::string message;
    try {
      replay(lines, *bench.car, bench.record);
    } catch (const InputError& error) {
      message = error.what();
    }
    TEST_ASSERT_TRUE_MESSAGE(message.find(wrong.words) != std::string::npos, message.c_str());
  }
}

// As a person who drives alone: the cable is pulled, the car put down, its button pressed.
TEST(the_simulated_boards_button_starts_a_trial_without_a_cable) {
  Bench bench;
  bench.options.stored_parameters = {{"BUTTON_WIRED", 1.0f}, {"SERVO_DIVIDER", 3.0f}};
  bench.car = std::make_unique<LinkedCar>(bench.engine, bench.worlds, bench.options, kFirmware);
  bench.run(0.5);
  bench.send(bench.host.command(MAV_CMD_COMPONENT_ARM_DISARM, {1}));
  bench.run(0.1);
  bench.send(bench.host.command(MAV_CMD_FOLDCAR_START_TRIAL, {0.5f, 0, 2, 3, 7, 1}));
  bench.run(0.3);
  const auto batteries = bench.host.all<mavlink_battery_status_t>(MAVLINK_MSG_ID_BATTERY_STATUS,
                                                                  mavlink_msg_battery_status_decode);
  TEST_ASSERT_UINT_WITHIN(1, static_cast<unsigned>(1000 * bench.worlds[0].body.supply_v), batteries.back().voltages[0]);
  bench.inject(R"({"inject": "unplug", "for_s": 14})");
  bench.run(10);
  bench.inject(R"({"inject": "button", "for_s": 0.2})");
  bench.run(4.5);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_STATE_FINISHED, bench.trial().state);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_END_TIME_LIMIT, bench.trial().end);
  TEST_ASSERT_EQUAL_UINT8(FOLDCAR_LOG_STORED, bench.trial().log);
  TEST_ASSERT_TRUE(bench.x_m() > 0.5f);
}
