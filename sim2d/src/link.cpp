#include "link.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <optional>
#include <thread>

#include "built_engine.h"
#include "firmware_id.h"
#include "link_options.h"
#include "link_record.h"
#include "linked_car.h"
#include "port.h"

namespace foldcar {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kPause = std::chrono::milliseconds(2);
// A simulation that lags further behind real time does not make up for it.
constexpr double kLargestLag_s = 0.2;
// Simulated time (µs) between two reads of the port, at any speed.
constexpr std::uint64_t kPollPeriodUs = 20000;
constexpr std::size_t kReadSize = 4096;
// Bytes wait at the port while this process stands still (stopped, or a slow client holds it up): after a longer pause
// (wall time) they are too old to be executed.
constexpr auto kLongestPause = std::chrono::seconds(1);
// A simulation that is faster than real time waits for a host that has been silent for so much of its time (µs), less than
// the firmware's CMD_TIMEOUT_MS, but no longer (wall time) than a host that lives is silent.
constexpr std::uint64_t kSilenceUs = 200000;
constexpr auto kLongestSilence = std::chrono::seconds(1);
// Longest wait (ms) of a fast simulation for a slow client; in real time the bytes are lost, as on a cable.
constexpr int kWaitMs = 2000;

volatile std::sig_atomic_t stop_requested = 0;

void request_stop(int) { stop_requested = 1; }

void listen_to_signals() {
  struct sigaction action = {};
  action.sa_handler = request_stop;
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
  signal(SIGPIPE, SIG_IGN);
  // A link in the background of a terminal goes on without input, instead of being halted.
  signal(SIGTTIN, SIG_IGN);
}

// Lines of standard input, without waiting.
class InputLines {
 public:
  std::optional<std::string> next() {
    char bytes[1024];
    while (!ended_ && readable()) {
      const ssize_t count = ::read(STDIN_FILENO, bytes, sizeof bytes);
      if (count > 0) unread_.append(bytes, static_cast<std::size_t>(count));
      ended_ = count == 0 || (count < 0 && errno != EINTR && errno != EAGAIN);
    }
    const std::size_t end = unread_.find('\n');
    if (end == std::string::npos) return std::nullopt;
    std::string line = unread_.substr(0, end);
    unread_.erase(0, end + 1);
    return line;
  }

 private:
  // Asked before each read, rather than O_NONBLOCK set: a terminal's file description is shared with the shell, and the
  // setting would stay there.
  static bool readable() {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    return poll(&input, 1, 0) > 0;
  }

  std::string unread_;
  bool ended_ = false;
};

void print_line(const nlohmann::ordered_json& line) {
  std::printf("%s\n", line.dump().c_str());
  std::fflush(stdout);
}

void print_port(const Port& port) { print_line({{"port", port.name()}, {"firmware", FOLDCAR_FIRMWARE_ID}}); }

class Session {
 public:
  Session(const LinkOptions& options, Port& port, LinkRecord* record)
      : options_(options),
        port_(port),
        record_(record),
        car_(engine(), options.worlds, options.car, FOLDCAR_FIRMWARE_ID) {}

  void run() {
    print_port(port_);
    Clock::time_point started = Clock::now();
    std::uint64_t next_look_us = 0;
    while (stop_requested == 0) {
      const double wall_s = std::chrono::duration<double>(Clock::now() - started).count();
      const double due_s = wall_s * options_.speedup, now_s = 1e-6 * static_cast<double>(car_.now_us());
      if (due_s - now_s > kLargestLag_s * std::max(1.0, options_.speedup)) {
        const std::chrono::duration<double> behind((due_s - now_s) / options_.speedup);
        started += std::chrono::duration_cast<Clock::duration>(behind);
      }
      if (now_s >= due_s || waits_for_host()) {
        poll();
        std::this_thread::sleep_for(kPause);
        continue;
      }
      if (car_.now_us() >= next_look_us) {
        poll();
        next_look_us = car_.now_us() + kPollPeriodUs;
      }
      const std::vector<std::uint8_t> sent = car_.step();
      if (record_ != nullptr) record_->from_car(car_.now_us(), sent);
      if (!sent.empty()) port_.write(sent, options_.speedup > 1 ? kWaitMs : 0);
    }
    if (record_ != nullptr) record_->end(car_.now_us());
  }

 private:
  // Input that has arrived takes effect before the next step.
  void poll() {
    while (const std::optional<std::string> line = input_.next()) handle(*line);
    if (plugged_in_ != car_.plugged_in()) {
      plugged_in_ = car_.plugged_in();
      if (plugged_in_) {
        port_.plug_in();
        print_port(port_);
      } else {
        port_.unplug();
      }
    }
    const Clock::time_point now = Clock::now();
    const bool late = now - polled_ > kLongestPause;
    polled_ = now;
    // What is late is taken completely, so that none of it counts as new at the next look.
    do {
      const std::vector<std::uint8_t> arrived = port_.read(kReadSize);
      if (arrived.empty()) return;
      heard_ = now;
      heard_us_ = car_.now_us();
      if (record_ != nullptr) record_->to_car(car_.now_us(), arrived, late);
      car_.receive(arrived, late);
    } while (late);
  }

  // A host's heartbeats come by the wall clock, which a fast simulation leaves behind.
  bool waits_for_host() const {
    return options_.speedup > 1 && heard_ && plugged_in_ && car_.now_us() > heard_us_ + kSilenceUs &&
           Clock::now() - *heard_ < kLongestSilence;
  }

  void handle(const std::string& line) {
    try {
      const nlohmann::json parsed = parse_object(line);
      car_.inject(read_injection(parsed));
      if (record_ != nullptr) record_->inject(car_.now_us(), parsed);
      print_line({{"injected", parsed}, {"t_us", car_.now_us()}});
    } catch (const InputError& error) {
      print_line({{"error", error.what()}});
    }
  }

  const LinkOptions& options_;
  Port& port_;
  LinkRecord* record_;
  LinkedCar car_;
  InputLines input_;
  bool plugged_in_ = true;
  Clock::time_point polled_ = Clock::now();
  // When the last bytes of a host arrived, on the wall clock and on the car's.
  std::optional<Clock::time_point> heard_;
  std::uint64_t heard_us_ = 0;
};

int run_replay(const LinkOptions& options) {
  std::ifstream lines(options.replay);
  if (!lines) throw InputError(options.replay + ": cannot be read");
  LinkedCar car(engine(), options.worlds, options.car, FOLDCAR_FIRMWARE_ID);
  LinkRecord record(std::cout);
  try {
    replay(lines, car, record);
  } catch (const InputError& error) {
    throw InputError(options.replay + ": " + error.what());
  }
  return std::cout.flush() ? 0 : 2;
}

}  // namespace

int run_link(const std::vector<std::string>& words) {
  const LinkOptions options = read_link_options(words);
  if (!options.replay.empty()) return run_replay(options);
  std::ofstream file;
  if (!options.record.empty()) {
    file.open(options.record);
    if (!file) throw InputError(options.record + ": cannot be written");
  }
  LinkRecord record(file);
  listen_to_signals();
  const std::unique_ptr<Port> port = options.pty ? open_pseudo_terminal() : open_loopback_port(options.tcp_port);
  Session(options, *port, file.is_open() ? &record : nullptr).run();
  return file.is_open() && !file.flush() ? 2 : 0;
}

}  // namespace foldcar
