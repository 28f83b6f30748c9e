// MAVLink's parameter protocol over the one table.
//
// A list goes out as fast as the outbox has room; a host asks again, by index, for what was lost on the way.
#pragma once

#include <cstddef>
#include <cstdint>

#include "application.h"
#include "outbox.h"
#include "status_text.h"

namespace foldcar {

class ParameterService {
 public:
  ParameterService(Application& application, Outbox& outbox, StatusText& status_text)
      : application_(application), outbox_(outbox), status_text_(status_text) {}

  // Each for a message meant for this car.
  void list();
  void read(const mavlink_param_request_read_t& request);
  void set(const mavlink_param_set_t& request);

  // Sends what is left of a list.
  void run();

 private:
  bool send(std::size_t index);
  void say_refused(const char* name, const char* why);

  Application& application_;
  Outbox& outbox_;
  StatusText& status_text_;
  std::size_t next_index_ = kParameterCount;
};

}  // namespace foldcar
