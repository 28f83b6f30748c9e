// The port on which a simulated car is offered: a pseudo-terminal, or a TCP port of this machine for one client. POSIX.
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
  // The address for clients: a device's path, or tcp:127.0.0.1:PORT.
  virtual std::string name() const = 0;
  // Returns up to most bytes that have arrived from the client, without waiting.
  virtual std::vector<std::uint8_t> read(std::size_t most) = 0;
  // Sends bytes to the client, and waits at most wait_ms (ms) for room. Without a client they are lost.
  virtual void write(const std::vector<std::uint8_t>& bytes, int wait_ms) = 0;
  // Unplugs the cable: the client's port closes. plug_in() offers a port again, a pseudo-terminal under another name.
  virtual void unplug() = 0;
  virtual void plug_in() = 0;
};

// Both throw std::runtime_error if the system refuses. port: 0 to 65535, 0 for any free one.
std::unique_ptr<Port> open_pseudo_terminal();
std::unique_ptr<Port> open_loopback_port(int port);

}  // namespace foldcar
