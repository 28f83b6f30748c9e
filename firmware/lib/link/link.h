// The car's end of the link: understands what hosts send, tells what the car does.
//
// Input: the bytes of the HAL's link, and the state of the application. Output: requests to the application, bytes to the
// link. Rate: receive() and flush() as often as one likes, run() after every tick. No heap, nothing waits.
#pragma once

#include <array>
#include <cstdint>

#include "application.h"
#include "car_messages.h"
#include "command_service.h"
#include "hal.h"
#include "log_service.h"
#include "outbox.h"
#include "packet_parser.h"
#include "parameter_service.h"
#include "status_text.h"
#include "telemetry.h"
#include "trial_log.h"

namespace foldcar {

class Link {
 public:
  // All must outlive the link. build: 16 hexadecimal digits.
  Link(const Hal& hal, Application& application, const LoopStatistics& loop, const char* build);

  void receive();
  void run();
  void flush() { outbox_.flush(hal_.link); }

  // A host has asked for a restart of the board.
  bool restart_is_due() const { return commands_.restart_is_due(); }

 private:
  void understand(const mavlink_message_t& message);
  // Notes that a host is there; true if it was heard shortly before, too.
  bool is_known(std::uint8_t system);
  void drive_by_hand(const mavlink_message_t& message, bool known_host);
  void answer_timesync(const mavlink_message_t& message);
  void answer_ping(const mavlink_message_t& message);
  void tell_changes();
  CarView view() const;

  Hal hal_;
  Application& application_;
  const LoopStatistics& loop_;
  const char* build_;
  PacketParser parser_;
  Outbox outbox_;
  StatusText status_text_{outbox_};
  Telemetry telemetry_;
  ParameterService parameters_{application_, outbox_, status_text_};
  CommandService commands_{application_, hal_, telemetry_, outbox_, status_text_};
  TrialLog trial_log_{hal_.logs, status_text_};
  LogService logs_{hal_.logs, outbox_};
  std::uint8_t driver_system_ = 0;  // the host that set the wheels in motion
  std::array<std::uint32_t, 256> heard_ms_{};  // by system; 0 never
  Fault told_fault_ = Fault::kNone;
};

}  // namespace foldcar
