// MAVLink's parameter protocol over the parameter table.
//
// A list is sent as fast as the outbox has room; a host requests lost values again by their index.
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

  // Each handles a message for this car.
  void list();
  void read(const mavlink_param_request_read_t& request);
  void set(const mavlink_param_set_t& request);
  // Answers a setting that is not allowed now; why: for people.
  void refuse(const mavlink_param_set_t& request, Refusal refusal, const char* why);

  // Continues a list, as far as the outbox has room, and saves a parameter that was set. may_save: whether flash may be
  // written now; what was set waits until then.
  void run(bool may_save);

 private:
  void save_one();
  bool send(std::size_t index);
  // Sends the refusal for programs and, as "NAME why", for people.
  void report_refusal(const char* name, Refusal refusal, const char* why);

  Application& application_;
  Outbox& outbox_;
  StatusText& status_text_;
  std::size_t next_index_ = kParameterCount;
};

}  // namespace foldcar
