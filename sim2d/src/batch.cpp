#include "batch.h"

#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <deque>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

#include "batch_session.h"
#include "worker.h"

namespace foldcar {
namespace {

// Lines read ahead of the oldest run under way: enough to keep workers busy, little enough to stay small.
constexpr std::size_t kReadAhead = 64;

class Batch {
 public:
  Batch(const BatchOptions& options, int input, int output) : options_(options), input_(input), output_(output) {
    workers_.reserve(static_cast<std::size_t>(options.jobs));
    for (int i = 0; i < options.jobs; ++i) workers_.emplace_back(options.timing);
  }

  int run() {
    const auto start = std::chrono::steady_clock::now();
    while (!input_ended_ || !slots_.empty() || !unread_.empty()) {
      take_lines();
      start_jobs();
      write_replies();
      if (input_ended_ && slots_.empty() && unread_.empty()) break;
      wait();
    }
    if (options_.timing) {
      report_timing(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    }
    return any_error_ ? 2 : 0;
  }

 private:
  // A reply's place in the output: filled when it is known.
  struct Slot {
    std::optional<Job> job;  // until a worker has it
    std::optional<std::string> reply;
  };

  void wait() {
    std::vector<pollfd> events;
    const bool reads = !input_ended_ && slots_.size() < kReadAhead;
    if (reads) events.push_back({input_, POLLIN, 0});
    for (const Worker& worker : workers_) {
      if (worker.busy()) events.push_back({worker.descriptor(), POLLIN, 0});
    }
    if (events.empty()) return;
    if (poll(events.data(), events.size(), -1) < 0) {
      if (errno == EINTR) return;
      throw std::runtime_error(std::string("cannot wait for input: ") + std::strerror(errno));
    }
    for (const pollfd& event : events) {
      if (event.revents == 0) continue;
      if (event.fd == input_) {
        read_input();
      } else {
        receive(event.fd);
      }
    }
  }

  void read_input() {
    char chunk[65536];
    const ssize_t count = read(input_, chunk, sizeof chunk);
    if (count < 0 && errno != EINTR) {
      throw std::runtime_error(std::string("cannot read the input: ") + std::strerror(errno));
    }
    if (count > 0) unread_.append(chunk, static_cast<std::size_t>(count));
    if (count == 0) {
      input_ended_ = true;
      if (!unread_.empty() && unread_.back() != '\n') unread_ += '\n';
    }
  }

  void take_lines() {
    std::size_t from = 0;
    while (slots_.size() < kReadAhead) {
      const std::size_t end = unread_.find('\n', from);
      if (end == std::string::npos) break;
      ++line_number_;
      take_line(unread_.substr(from, end - from));
      from = end + 1;
    }
    unread_.erase(0, from);
  }

  // Definitions are kept as text for the workers, runs queue up; what cannot be used is answered at once.
  void take_line(const std::string& line) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) return;
    std::string run_id;
    try {
      const nlohmann::json parsed = parse_object(line);
      run_id = run_id_if_any(parsed);
      switch (line_kind(parsed)) {
        case LineKind::kBody: define("body " + read_body(parsed).id, line); return;
        case LineKind::kScene: define("scene " + read_scene(parsed).id, line); return;
        case LineKind::kHeights: {
          Job job{line_number_, {}, {}, line};
          add_definition("scene " + read_heights(parsed).scene, job);
          slots_.push_back({std::move(job), std::nullopt});
          return;
        }
        case LineKind::kPulses:
          read_pulses(parsed);
          slots_.push_back({Job{line_number_, {}, {}, line}, std::nullopt});
          return;
        case LineKind::kRun: break;
      }
      const RunLine run = read_run(parsed);
      Job job{line_number_, run.id, {}, line};
      add_definition("body " + run.body, job);
      add_definition("scene " + run.scene, job);
      slots_.push_back({std::move(job), std::nullopt});
    } catch (const std::exception& error) {
      slots_.push_back({std::nullopt, error_reply(line_number_, run_id, ErrorKind::kInput, error.what())});
    }
  }

  void define(const std::string& key, const std::string& line) {
    definitions_[key] = std::make_shared<const Definition>(Definition{key, line});
  }

  // One that is unknown is left out: the worker's session says so.
  void add_definition(const std::string& key, Job& job) const {
    const auto found = definitions_.find(key);
    if (found != definitions_.end()) job.definitions.push_back(found->second);
  }

  void start_jobs() {
    std::size_t worker = 0;
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      Slot& slot = slots_[i];
      if (!slot.job) continue;
      while (worker < workers_.size() && workers_[worker].busy()) ++worker;
      if (worker == workers_.size()) return;
      workers_[worker].start(*slot.job);
      slot.job.reset();
      slot_of_[workers_[worker].descriptor()] = written_ + i;
    }
  }

  void receive(int descriptor) {
    for (Worker& worker : workers_) {
      if (!worker.busy() || worker.descriptor() != descriptor) continue;
      if (std::optional<std::string> reply = worker.receive()) {
        slots_[slot_of_.at(descriptor) - written_].reply = std::move(reply);
        slot_of_.erase(descriptor);
      }
      return;
    }
  }

  void write_replies() {
    std::string text;
    while (!slots_.empty() && slots_.front().reply) {
      const std::string& reply = *slots_.front().reply;
      any_error_ = any_error_ || reply.compare(0, 9, "{\"error\":") == 0;
      text += reply + "\n";
      slots_.pop_front();
      ++written_;
    }
    std::size_t done = 0;
    while (done < text.size()) {
      const ssize_t count = write(output_, text.data() + done, text.size() - done);
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) throw std::runtime_error(std::string("cannot write the output: ") + std::strerror(errno));
      done += static_cast<std::size_t>(count);
    }
  }

  // Sums over the workers, and the wall time of the whole batch, as one line on standard error.
  void report_timing(double wall_s) {
    nlohmann::ordered_json sum = {{"wall_s", wall_s}};
    for (Worker& worker : workers_) {
      const std::string line = worker.finish();
      if (line.empty()) continue;
      const nlohmann::ordered_json timing = nlohmann::ordered_json::parse(line);
      for (const auto& [key, value] : timing.at("timing").items()) {
        sum[key] = sum.value(key, 0.0) + value.get<double>();
      }
    }
    std::fprintf(stderr, "%s\n", nlohmann::ordered_json{{"timing", sum}}.dump().c_str());
  }

  BatchOptions options_;
  int input_, output_;
  bool input_ended_ = false;
  bool any_error_ = false;
  std::size_t line_number_ = 0;
  std::string unread_;
  std::unordered_map<std::string, std::shared_ptr<const Definition>> definitions_;
  std::deque<Slot> slots_;
  std::size_t written_ = 0;  // slots that have left the queue
  std::unordered_map<int, std::size_t> slot_of_;
  std::vector<Worker> workers_;
};

}  // namespace

int run_batch(const BatchOptions& options, int input, int output) { return Batch(options, input, output).run(); }

}  // namespace foldcar
