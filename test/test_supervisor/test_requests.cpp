// Refusals of requests for a trial, with their reasons.
#include "../suite.h"

#include <cmath>
#include <limits>

#include "supervisor_bench.h"

namespace foldcar {
namespace {

Refusal answer(const TrialRequest& request, const Parameters& parameters = Parameters()) {
  Supervisor supervisor(parameters);
  supervisor.arm(kGoodV, 0);
  const Refusal refusal = supervisor.start(request, 0);
  TEST_ASSERT_TRUE(supervisor.pulses_enabled() == (refusal == Refusal::kNone));
  return refusal;
}

TEST(a_request_beyond_the_limits_is_refused_with_its_reason) {
  const float infinity = std::numeric_limits<float>::infinity();
  TEST_ASSERT_TRUE(answer({NAN, 0.0f, 1.0f, false, 0}) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer({0.1f, NAN, 1.0f, false, 0}) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, NAN, false, 0}) == Refusal::kNotANumber);
  TEST_ASSERT_TRUE(answer({5.0f, 100.0f, 1.0f, false, 0}) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer({-5.0f, -100.0f, 1.0f, false, 0}) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer({5.001f, 0.0f, 1.0f, false, 0}) == Refusal::kSpeedLimit);
  TEST_ASSERT_TRUE(answer({-infinity, 0.0f, 1.0f, false, 0}) == Refusal::kSpeedLimit);
  TEST_ASSERT_TRUE(answer({0.1f, -100.1f, 1.0f, false, 0}) == Refusal::kYawRateLimit);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, 0.0f, false, 0}) == Refusal::kTimeLimit);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, -1.0f, false, 0}) == Refusal::kTimeLimit);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, infinity, false, 0}) == Refusal::kTimeLimit);
}

TEST(the_longest_trial_is_a_parameter) {
  Parameters parameters;
  parameters.set("TRIAL_MAX_S", 20.0f);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, 20.0f, false, 0}, parameters) == Refusal::kNone);
  TEST_ASSERT_TRUE(answer({0.1f, 0.0f, 20.01f, false, 0}, parameters) == Refusal::kTimeLimit);
}

TEST(a_car_without_a_wheel_on_a_side_does_not_start) {
  Parameters parameters;
  parameters.set("CH2_SIDE", 0.0f);
  TEST_ASSERT_TRUE(answer(kTrial, parameters) == Refusal::kNone);
  parameters.set("CH4_SIDE", 0.0f);
  TEST_ASSERT_TRUE(answer(kTrial, parameters) == Refusal::kNoWheels);
  parameters.set("CH8_SIDE", 2.0f);
  TEST_ASSERT_TRUE(answer(kTrial, parameters) == Refusal::kNone);
}

}  // namespace

}  // namespace foldcar
