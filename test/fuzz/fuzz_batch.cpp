// Lines of `carsim batch`: none may crash, reach an assertion, cost too much or be answered by what is no JSON.
#include "batch_session.h"
#include "lines.h"
#include "multibody_engine.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const foldcar::MultibodyEngine engine;
  foldcar::BatchSession session(engine, false);
  return foldcar::answer_all(session, data, size);
}
