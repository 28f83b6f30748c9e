// Sends lines for people, as STATUSTEXT.
#pragma once

#include <cstdint>

#include "outbox.h"

namespace foldcar {

class StatusText {
 public:
  explicit StatusText(Outbox& outbox) : outbox_(outbox) {}

  // A line of more than 50 bytes is sent in parts, which the receiver joins.
  void send(MAV_SEVERITY severity, const char* text);
  // The line "subject predicate", cut off at 159 bytes.
  void send(MAV_SEVERITY severity, const char* subject, const char* predicate);

 private:
  Outbox& outbox_;
  std::uint16_t next_id_ = 1;
};

}  // namespace foldcar
