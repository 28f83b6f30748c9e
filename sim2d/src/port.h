// The port that a simulated car is offered on: a pseudo-terminal, or one client of a loopback TCP port. POSIX.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace foldcar {

class Port {
 public:
  virtual ~Port() = default;
  // What a client connects to: a device's path, or tcp:127.0.0.1:PORT.
  virtual std::string name() const = 0;
  // What has arrived from a client, up to so many bytes; never waits.
  virtual std::vector<std::uint8_t> read(std::size_t most) = 0;
  // Bytes to the client; lost without one. A client that does not read is waited for, at most wait_ms in all.
  virtual void write(const std::vector<std::uint8_t>& bytes, int wait_ms) = 0;
  // Pulls the cable: the client sees the port vanish. plug_in() offers it anew, a pseudo-terminal under another name.
  virtual void unplug() = 0;
  virtual void plug_in() = 0;
};

// Both throw std::runtime_error if the system refuses. Port 0 takes a free one.
std::unique_ptr<Port> open_pseudo_terminal();
std::unique_ptr<Port> open_loopback_port(int port);

}  // namespace foldcar
