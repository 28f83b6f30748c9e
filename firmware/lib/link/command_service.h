// Executes and acknowledges COMMAND_LONG. docs/link.md lists the commands.
#pragma once

#include <cstdint>

#include "application.h"
#include "car_messages.h"
#include "host.h"
#include "outbox.h"
#include "status_text.h"
#include "telemetry.h"
#include "trial_log.h"

namespace foldcar {

class CommandService {
 public:
  CommandService(Application& application, Hal& hal, Telemetry& telemetry, const TrialLog& trial_log, Outbox& outbox,
                 StatusText& status_text)
      : application_(application),
        hal_(hal),
        telemetry_(telemetry),
        trial_log_(trial_log),
        outbox_(outbox),
        status_text_(status_text) {}

  // Handles a command for this car. Whoever arms the car or tests an output becomes its controlling host: while it is
  // armed, all others may only stop and disarm it and ask for messages.
  void handle(const mavlink_command_long_t& command, const Sender& sender, const CarView& car, Host& controlling_host);
  // Answers a request that this car does not know; command: the number that the acknowledgement carries.
  void refuse(std::uint16_t command, const Host& host, MAV_RESULT result);

  // Whether a restart has been requested; its acknowledgement is in the outbox.
  bool restart_is_due() const { return restart_is_due_; }

 private:
  // What COMMAND_ACK says.
  struct Answer {
    MAV_RESULT result = MAV_RESULT_ACCEPTED;
    Refusal refusal = Refusal::kNone;
  };

  Answer execute(const mavlink_command_long_t& command, const Sender& sender, const CarView& car,
                 const Host& controlling_host);
  void report(const mavlink_command_long_t& command, const Host& host, const Answer& answer, bool was_armed,
              const Host& controlling_host);
  void acknowledge(std::uint16_t command, const Host& host, const Answer& answer);
  Answer arm_or_disarm(float arm);
  Answer test(const mavlink_command_long_t& command);
  Answer start(const mavlink_command_long_t& command);
  Answer send_message(std::uint32_t message_id, const CarView& car);
  Answer send_interval(float message_id);
  Answer reset_parameters(float request);
  Answer restart(float request);
  bool is_repeated(const mavlink_command_long_t& command, const Host& host) const;

  Application& application_;
  Hal& hal_;
  Telemetry& telemetry_;
  const TrialLog& trial_log_;
  Outbox& outbox_;
  StatusText& status_text_;
  bool restart_is_due_ = false;
  bool has_last_ = false;
  mavlink_command_long_t last_{};
  Host last_host_;
  std::uint64_t last_us_ = 0;
  Answer last_answer_;
};

}  // namespace foldcar
