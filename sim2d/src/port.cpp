#include "port.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace foldcar {
namespace {

[[noreturn]] void fail(const std::string& what) { throw std::runtime_error(what + ": " + std::strerror(errno)); }

// A file descriptor that its owner closes.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  int number() const { return number_; }
  bool is_open() const { return number_ >= 0; }

 private:
  int number_ = -1;
};

// Reads up to most bytes into bytes. Returns false if the other end is closed.
bool read_some(int descriptor, std::size_t most, std::vector<std::uint8_t>& bytes) {
  bytes.resize(most);
  const ssize_t count = ::read(descriptor, bytes.data(), most);
  const int error = errno;
  bytes.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
  if (count > 0) return true;
  return count < 0 && (error == EAGAIN || error == EINTR);
}

// Writes all bytes, and waits at most wait_ms for room each time. Returns false if the other end is closed.
bool write_all(int descriptor, const std::vector<std::uint8_t>& bytes, int wait_ms) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count = ::write(descriptor, bytes.data() + done, bytes.size() - done);
    if (count > 0) {
      done += static_cast<std::size_t>(count);
    } else if (count < 0 && errno == EAGAIN) {
      pollfd wanted{descriptor, POLLOUT, 0};
      if (poll(&wanted, 1, wait_ms) <= 0) return true;
      if ((wanted.revents & (POLLHUP | POLLERR)) != 0) return false;
    } else if (!(count < 0 && errno == EINTR)) {
      return false;
    }
  }
  return true;
}

class PseudoTerminal final : public Port {
 public:
  PseudoTerminal() { plug_in(); }

  std::string name() const override { return name_; }

  std::vector<std::uint8_t> read(std::size_t most) override {
    std::vector<std::uint8_t> bytes;
    if (has_client()) read_some(master_.number(), most, bytes);
    return bytes;
  }

  // Without a client the bytes would be kept for the next one, which must not get old telemetry.
  void write(const std::vector<std::uint8_t>& bytes, int wait_ms) override {
    if (has_client()) write_all(master_.number(), bytes, wait_ms);
  }

  void unplug() override { master_ = Descriptor(); }

  void plug_in() override {
    master_ = Descriptor(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC));
    if (!master_.is_open() || grantpt(master_.number()) != 0 || unlockpt(master_.number()) != 0) {
      fail("no pseudo-terminal");
    }
    name_ = ptsname(master_.number());
    // Raw mode, so that no byte is changed. The setting stays while the master is open.
    const Descriptor client(::open(name_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC));
    termios setting{};
    if (!client.is_open() || tcgetattr(client.number(), &setting) != 0) fail(name_);
    cfmakeraw(&setting);
    if (tcsetattr(client.number(), TCSANOW, &setting) != 0) fail(name_);
    fcntl(master_.number(), F_SETFL, O_NONBLOCK);
  }

 private:
  bool has_client() const {
    if (!master_.is_open()) return false;
    pollfd state{master_.number(), 0, 0};
    return poll(&state, 1, 0) >= 0 && (state.revents & POLLHUP) == 0;
  }

  Descriptor master_;
  std::string name_;
};

class LoopbackPort : public Port {
 public:
  explicit LoopbackPort(int port) : listener_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    const int yes = 1;
    setsockopt(listener_.number(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    auto* const general = reinterpret_cast<sockaddr*>(&address);
    socklen_t size = sizeof address;
    const std::string what = "TCP port " + std::to_string(port);
    if (!listener_.is_open() || bind(listener_.number(), general, size) != 0) fail(what);
    if (listen(listener_.number(), 1) != 0 || getsockname(listener_.number(), general, &size) != 0) fail(what);
    port_ = ntohs(address.sin_port);
  }

  std::string name() const override { return "tcp:127.0.0.1:" + std::to_string(port_); }

  std::vector<std::uint8_t> read(std::size_t most) override {
    accept_client();
    std::vector<std::uint8_t> bytes;
    if (client_.is_open() && !read_some(client_.number(), most, bytes)) client_ = Descriptor();
    return bytes;
  }

  void write(const std::vector<std::uint8_t>& bytes, int wait_ms) override {
    if (client_.is_open() && !write_all(client_.number(), bytes, wait_ms)) client_ = Descriptor();
  }

  void unplug() override {
    client_ = Descriptor();
    plugged_in_ = false;
  }

  void plug_in() override { plugged_in_ = true; }

 private:
  // One client at a time, as on a cable: another connection is closed at once.
  void accept_client() {
    Descriptor caller(accept4(listener_.number(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!caller.is_open() || client_.is_open() || !plugged_in_) return;
    const int yes = 1;
    setsockopt(caller.number(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    client_ = std::move(caller);
  }

  Descriptor listener_, client_;
  int port_ = 0;
  bool plugged_in_ = true;
};

}  // namespace

std::unique_ptr<Port> open_pseudo_terminal() { return std::make_unique<PseudoTerminal>(); }

std::unique_ptr<Port> open_loopback_port(int port) { return std::make_unique<LoopbackPort>(port); }

}  // namespace foldcar
