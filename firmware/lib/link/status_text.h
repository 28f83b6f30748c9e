// Lines for people, as STATUSTEXT.
#pragma once

#include <cstdint>

#include "outbox.h"

namespace foldcar {

class StatusText {
 public:
  explicit StatusText(Outbox& outbox) : outbox_(outbox) {}

  // A line longer than one packet goes out in parts, which receivers put together again.
  void send(MAV_SEVERITY severity, const char* text);
  // "name says": two parts with a space between.
  void send(MAV_SEVERITY severity, const char* name, const char* says);

 private:
  Outbox& outbox_;
  std::uint16_t next_id_ = 1;
};

}  // namespace foldcar
