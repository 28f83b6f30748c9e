#include "step.h"

#include "answer_lines.h"
#include "built_engine.h"
#include "step_session.h"

namespace foldcar {

int run_step() {
  StepSession session(engine());
  return answer_lines([&](std::size_t number, const std::string& line) { return session.answer(number, line); });
}

}  // namespace foldcar
