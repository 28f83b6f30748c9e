// The car's end of the MAVLink connection: handles the packets of hosts and sends the car's own.
//
// Input: bytes from the HAL's link, the application's state. Output: requests to the application, bytes to the link.
// Rate: receive() and flush() at any rate, run() after every tick. Uses no heap and never waits.
#pragma once

#include <array>
#include <cstdint>

#include "application.h"
#include "car_messages.h"
#include "command_service.h"
#include "hal.h"
#include "host.h"
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
  // The arguments and the parts of hal must outlive the link. build: 16 hexadecimal digits.
  Link(const Hal& hal, Application& application, const LoopStatistics& loop, const char* build);

  // Handles the packets that have arrived. late: they waited while the loop stood still; nothing is executed then but what
  // makes the car stand.
  void receive(bool late);
  // Forgets the bytes that have arrived.
  void discard();
  // Sends what is due: changes of the state, parameters, logs, telemetry; records an untethered trial.
  void run();
  // Hands waiting bytes to the HAL's link.
  void flush() { outbox_.flush(hal_.link); }

  // For another task: stores a part of a trial's log. Returns whether there is more to do at once.
  bool store_log() { return trial_log_.store(); }

  LogState log_state() const { return trial_log_.status().state; }

  // Whether a host has requested a restart of the board, and all is stored.
  bool restart_is_due() const;

 private:
  void handle(const mavlink_message_t& message, bool late);
  void handle_late(const mavlink_message_t& message);
  void handle_log_request(const mavlink_message_t& message, const Sender& sender);
  void set_parameter(const mavlink_message_t& message, const Sender& sender);
  void refuse_stations_controls(const mavlink_message_t& message, const Sender& sender);
  // Records that a packet of a host has arrived; the host is given by its system number. Returns whether the host is known:
  // its packet before that one came at most kKnownHostMs earlier.
  bool note_host(std::uint8_t system);
  // Whether another host than the sender has armed the car.
  bool is_controlled_by_other(const Sender& sender) const {
    return application_.is_armed() && sender.host != controlling_host_;
  }
  // Says that a control which a host sends many times a second is refused, once in a while.
  void complain(const char* why);
  void drive_manually(const mavlink_message_t& message, const Sender& sender);
  void answer_mission_list(const mavlink_message_t& message);
  void answer_timesync(const mavlink_message_t& message);
  void answer_ping(const mavlink_message_t& message);
  void report_changes();
  void report_fault();
  void send_crash_report();
  void report_host_timeout();
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
  TrialLog trial_log_{hal_.logs, status_text_};
  CommandService commands_{application_, hal_, telemetry_, trial_log_, outbox_, status_text_};
  LogService logs_{hal_.logs, outbox_};
  Host controlling_host_;  // the host that armed the car last
  std::array<std::uint32_t, 256> last_packet_ms_{};  // by system number; 0 before the first
  Fault reported_fault_ = Fault::kNone;
  bool reported_host_timeout_ = false;
  bool host_is_new_ = false;  // a host that was not known has sent a packet
  std::uint64_t next_complaint_us_ = 0;
};

}  // namespace foldcar
