#include "answer_lines.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <stdexcept>

namespace foldcar {

int answer_lines(const LineAnswer& answer) {
  std::ios::sync_with_stdio(false);
  bool any_error = false;
  std::string line;
  for (std::size_t number = 1; std::getline(std::cin, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    const std::optional<std::string> reply = answer(number, line);
    if (!reply) continue;
    any_error = any_error || reply->compare(0, 9, "{\"error\":") == 0;
    const std::string written = *reply + "\n";
    if (std::fwrite(written.data(), 1, written.size(), stdout) != written.size() || std::fflush(stdout) != 0) {
      throw std::runtime_error(std::string("cannot write the output: ") + std::strerror(errno));
    }
  }
  return any_error ? 2 : 0;
}

}  // namespace foldcar
