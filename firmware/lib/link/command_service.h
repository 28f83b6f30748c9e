// COMMAND_LONG: carries out a command and answers it. docs/link.md has the list.
#pragma once

#include <cstdint>

#include "application.h"
#include "car_messages.h"
#include "outbox.h"
#include "status_text.h"
#include "telemetry.h"

namespace foldcar {

class CommandService {
 public:
  CommandService(Application& application, Hal& hal, Telemetry& telemetry, Outbox& outbox, StatusText& status_text)
      : application_(application), hal_(hal), telemetry_(telemetry), outbox_(outbox), status_text_(status_text) {}

  // A command meant for this car, and the packet it came in. Wheels are set in motion for known hosts only;
  // driver_system becomes the one that did it.
  void obey(const mavlink_command_long_t& command, const mavlink_message_t& packet, bool known_host,
            const CarView& car, std::uint8_t& driver_system);

  // A restart that was asked for, once its answer is on its way.
  bool restart_is_due() const { return restart_is_due_; }

 private:
  struct Answer {
    MAV_RESULT result = MAV_RESULT_ACCEPTED;
    Refusal refusal = Refusal::kNone;
  };

  Answer carry_out(const mavlink_command_long_t& command, bool known_host, const CarView& car);
  Answer arm_or_disarm(float wish);
  Answer test(const mavlink_command_long_t& command);
  Answer start(const mavlink_command_long_t& command);
  Answer send_message(std::uint32_t message_id, const CarView& car);
  Answer tell_interval(float message_id);
  Answer reset_parameters(float wish);
  Answer restart(float wish);
  bool is_repeated(const mavlink_command_long_t& command, std::uint8_t sender_system) const;

  Application& application_;
  Hal& hal_;
  Telemetry& telemetry_;
  Outbox& outbox_;
  StatusText& status_text_;
  bool restart_is_due_ = false;
  bool any_ = false;
  mavlink_command_long_t last_{};
  std::uint8_t last_sender_ = 0;
  std::uint64_t last_us_ = 0;
  Answer last_answer_;
};

}  // namespace foldcar
