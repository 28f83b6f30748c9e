// The options of `carsim link` and the content of the files that they name.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "linked_car.h"

namespace foldcar {

// Wrong options; the message names the option and its limits.
class LinkUsageError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct LinkOptions {
  bool pty = false;    // a pseudo-terminal
  int tcp_port = -1;   // a TCP port of this machine, 0 for any free one, -1 for none
  double speedup = 1;  // simulated time over real time
  std::string record;  // record to write, "" for none
  std::string replay;  // record to repeat instead of a port, "" for none
  std::vector<LinkedWorld> worlds;
  LinkedCarOptions car;
};

// Reads options and files. Throws LinkUsageError for wrong options, InputError with the file's name for a wrong file.
LinkOptions read_link_options(const std::vector<std::string>& words);

}  // namespace foldcar
