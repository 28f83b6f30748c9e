// One worker process of a batch: a serial session behind a socket, so that a run that crashes takes only
// itself along.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

namespace foldcar {

// A body or scene line that runs refer to; key tells which one it defines.
struct Definition {
  std::string key;
  std::string line;
};

// What a worker is given: definitions, then the one line that calls for a reply.
struct Job {
  std::size_t line_number = 0;
  std::string run_id;
  std::vector<std::shared_ptr<const Definition>> definitions;
  std::string run;
};

class Worker {
 public:
  explicit Worker(bool timed);
  ~Worker();
  Worker(Worker&& other) noexcept;
  Worker& operator=(Worker&&) = delete;

  bool busy() const { return busy_; }
  int descriptor() const { return socket_; }
  void start(const Job& job);
  // Reads what has arrived; the reply once it is whole. A dead worker's reply is an error line, after which
  // the worker has been replaced by a new process.
  std::optional<std::string> receive();
  // Ends the worker and returns its {"timing": …} line, empty unless timed.
  std::string finish();

 private:
  void spawn();
  std::string reap();

  bool timed_;
  pid_t process_ = -1;
  int socket_ = -1;
  bool busy_ = false;
  std::size_t line_number_ = 0;
  std::string run_id_;
  std::string received_;
  std::unordered_map<std::string, std::shared_ptr<const Definition>> known_;  // to the process, by key
};

}  // namespace foldcar
