#include "step.h"

#include <iostream>
#include <optional>
#include <string>

#include "step_session.h"

namespace foldcar {

int run_step() {
  std::ios::sync_with_stdio(false);
  StepSession session;
  bool any_error = false;
  std::string line;
  for (std::size_t number = 1; std::getline(std::cin, line); ++number) {
    const std::optional<std::string> reply = session.answer(number, line);
    if (!reply) continue;
    any_error = any_error || reply->compare(0, 9, "{\"error\":") == 0;
    // The caller waits for this very line.
    if (!(std::cout << *reply << std::endl)) return 2;
  }
  return any_error ? 2 : 0;
}

}  // namespace foldcar
