#include "worker.h"

#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "batch_session.h"

namespace foldcar {
namespace {

// All of data, even if the other end takes it in parts; false if that end is gone.
bool send_all(int socket, const std::string& data) {
  std::size_t sent = 0;
  while (sent < data.size()) {
    const ssize_t count = send(socket, data.data() + sent, data.size() - sent, MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    sent += static_cast<std::size_t>(count);
  }
  return true;
}

// What arrives next, appended to buffer; false at the end.
bool receive_some(int socket, std::string& buffer) {
  char chunk[65536];
  for (;;) {
    const ssize_t count = recv(socket, chunk, sizeof chunk, 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    buffer.append(chunk, static_cast<std::size_t>(count));
    return true;
  }
}

bool take_line(std::string& buffer, std::string& line) {
  const std::size_t end = buffer.find('\n');
  if (end == std::string::npos) return false;
  line = buffer.substr(0, end);
  buffer.erase(0, end + 1);
  return true;
}

std::string timing_line(const BatchSession& session) {
  const Stopwatch& watch = session.stopwatch();
  return nlohmann::ordered_json{{"timing",
                                 {{"simulated_s", session.simulated_s()},
                                  {"physics_s", watch.physics_s},
                                  {"terrain_s", watch.terrain_s},
                                  {"firmware_s", watch.firmware_s}}}}
      .dump();
}

// The worker's life: "<line number> <line>" in, replies out, until the other end closes.
[[noreturn]] void serve(int socket, bool timed) {
  BatchSession session(timed);
  std::string buffer, line;
  for (;;) {
    while (take_line(buffer, line)) {
      const std::size_t space = line.find(' ');
      const std::size_t number = std::strtoull(line.c_str(), nullptr, 10);
      const std::optional<std::string> reply = session.answer(number, line.substr(space + 1));
      if (reply && !send_all(socket, *reply + "\n")) _exit(0);
    }
    if (!receive_some(socket, buffer)) break;
  }
  if (timed) send_all(socket, timing_line(session) + "\n");
  _exit(0);
}

}  // namespace

Worker::Worker(bool timed) : timed_(timed) { spawn(); }

Worker::Worker(Worker&& other) noexcept
    : timed_(other.timed_),
      process_(std::exchange(other.process_, -1)),
      socket_(std::exchange(other.socket_, -1)),
      busy_(other.busy_),
      line_number_(other.line_number_),
      run_id_(std::move(other.run_id_)),
      received_(std::move(other.received_)),
      known_(std::move(other.known_)) {}

Worker::~Worker() {
  if (socket_ >= 0) {
    // Closing alone is not heard: workers forked later hold copies of this end.
    shutdown(socket_, SHUT_RDWR);
    close(socket_);
  }
  if (process_ > 0) waitpid(process_, nullptr, 0);
}

void Worker::spawn() {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    throw std::runtime_error(std::string("no socket for a worker: ") + std::strerror(errno));
  }
  process_ = fork();
  if (process_ < 0) throw std::runtime_error(std::string("no process for a worker: ") + std::strerror(errno));
  if (process_ == 0) {
    // The batch reports a crash itself; a core file of every bad run would help nobody.
    close(ends[0]);
    serve(ends[1], timed_);
  }
  close(ends[1]);
  socket_ = ends[0];
}

void Worker::start(const Job& job) {
  busy_ = true;
  line_number_ = job.line_number;
  run_id_ = job.run_id;
  const std::string number = std::to_string(job.line_number) + " ";
  std::string message;
  for (const auto& definition : job.definitions) {
    std::shared_ptr<const Definition>& known = known_[definition->key];
    if (known == definition) continue;
    known = definition;
    message += number + definition->line + "\n";
  }
  // A worker that has died meanwhile is noticed when its reply is read.
  send_all(socket_, message + number + job.run + "\n");
}

std::optional<std::string> Worker::receive() {
  std::string reply;
  if (!receive_some(socket_, received_)) {
    busy_ = false;
    reply = error_reply(line_number_, run_id_, ErrorKind::kSimulation, "the simulation crashed (" + reap() + ")");
    spawn();
    return reply;
  }
  if (!take_line(received_, reply)) return std::nullopt;
  busy_ = false;
  return reply;
}

std::string Worker::finish() {
  shutdown(socket_, SHUT_WR);
  while (receive_some(socket_, received_)) {
  }
  std::string line;
  take_line(received_, line);
  reap();
  return line;
}

std::string Worker::reap() {
  close(socket_);
  socket_ = -1;
  int status = 0;
  waitpid(process_, &status, 0);
  process_ = -1;
  received_.clear();
  known_.clear();
  if (WIFSIGNALED(status)) return std::string("signal ") + strsignal(WTERMSIG(status));
  return "exit code " + std::to_string(WEXITSTATUS(status));
}

}  // namespace foldcar
