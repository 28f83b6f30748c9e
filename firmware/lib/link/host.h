// A host on the link: who sent a packet, and whether it may set the car in motion.
#pragma once

#include <cstdint>
#include <cstdio>

namespace foldcar {

// MAVLink's numbers of the program at the other end.
struct Host {
  std::uint8_t system = 0;
  std::uint8_t component = 0;
};

inline bool operator==(const Host& a, const Host& b) { return a.system == b.system && a.component == b.component; }
inline bool operator!=(const Host& a, const Host& b) { return !(a == b); }

// A host as status texts name it: "host 255/190".
struct HostName {
  explicit HostName(const Host& host) { std::snprintf(text, sizeof text, "host %u/%u", host.system, host.component); }
  char text[16];
};

// Why others are refused: "host 255/190 holds the car".
struct HeldBy {
  explicit HeldBy(const Host& host) { std::snprintf(text, sizeof text, "%s holds the car", HostName(host).text); }
  char text[32];
};

// The sender of one packet.
struct Sender {
  Host host;
  bool known = false;  // another packet of it came shortly before, so that this is not a damaged one
  bool late = false;   // the packet waited while the car's loop stood still
};

}  // namespace foldcar
