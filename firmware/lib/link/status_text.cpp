#include "status_text.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace foldcar {

// Sends a text, in several packets with a common id if it is longer than one.
void StatusText::send(MAV_SEVERITY severity, const char* text) {
  constexpr std::size_t kPart = sizeof(mavlink_statustext_t::text);
  const std::size_t length = std::strlen(text);
  mavlink_statustext_t content{};
  content.severity = static_cast<std::uint8_t>(severity);
  if (length > kPart) {
    content.id = next_id_;
    next_id_ = next_id_ == UINT16_MAX ? 1 : static_cast<std::uint16_t>(next_id_ + 1);
  }
  // A part that contains a zero is the last one. If the text fills its parts, an empty part follows, hence the <=; a text
  // of exactly one part needs none, because without an id it is complete.
  for (std::size_t sent = 0; sent <= length; sent += kPart) {
    if (sent == length && length <= kPart && length > 0) break;
    std::memset(content.text, 0, kPart);
    std::memcpy(content.text, text + sent, std::min(kPart, length - sent));
    outbox_.send(mavlink_msg_statustext_encode_status, content, Priority::kAnswer);
    ++content.chunk_seq;
  }
}

void StatusText::send(MAV_SEVERITY severity, const char* subject, const char* predicate) {
  char line[160];
  std::snprintf(line, sizeof line, "%s %s", subject, predicate);
  send(severity, line);
}

}  // namespace foldcar
