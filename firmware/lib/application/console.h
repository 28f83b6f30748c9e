// A console on the byte link: a status line once a second, and commands of one letter.
//
//   a arm   d disarm   g go (a short, slow trial straight ahead)   s stop   c clear (acknowledge) a fault
//
// Rate: poll() after every tick. It never waits: what the link does not take at once goes out at later polls.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "application.h"
#include "hal.h"

namespace foldcar {

class Console {
 public:
  Console(Application& application, ByteLink& link) : application_(application), link_(link) {}

  void poll(std::uint64_t now_us);

 private:
  void obey(char command);
  void compose_status_line();
  void send();

  Application& application_;
  ByteLink& link_;
  Refusal last_answer_ = Refusal::kNone;
  std::uint64_t next_status_us_ = 0;
  std::array<char, 160> line_{};
  std::size_t line_size_ = 0;
  std::size_t sent_size_ = 0;
};

}  // namespace foldcar
