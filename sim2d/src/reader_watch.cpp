#include "reader_watch.h"

#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <thread>

namespace foldcar {
namespace {

constexpr int kExitCode = 2;

void watch() {
  // Without requested events, poll reports that the other end is closed, and nothing else.
  pollfd output{STDOUT_FILENO, 0, 0};
  while (poll(&output, 1, -1) < 0 && errno == EINTR) {
  }
  _exit(kExitCode);
}

}  // namespace

void end_without_reader() {
  struct stat output = {};
  if (fstat(STDOUT_FILENO, &output) != 0 || !(S_ISFIFO(output.st_mode) || S_ISSOCK(output.st_mode))) return;
  // Signals are for the main thread.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  std::thread(watch).detach();
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

}  // namespace foldcar
