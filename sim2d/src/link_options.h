// The options of `carsim link`, and the files that they name.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "body_spec.h"
#include "linked_car.h"
#include "scene_spec.h"

namespace foldcar {

class LinkUsageError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct LinkOptions {
  bool pty = false;
  int tcp_port = -1;
  double speedup = 1;
  std::string record;  // file to write, "" for none
  std::string replay;  // file to read instead of a port
  BodySpec body;
  SceneSpec scene;
  LinkedCarOptions car;
};

// LinkUsageError for wrong options, InputError with the file's name for what a file holds.
LinkOptions read_link_options(const std::vector<std::string>& words);

}  // namespace foldcar
