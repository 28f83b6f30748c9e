// The simulator's elementary functions against the C library's in long double, whose 11 more bits make them a reference.
#include "../../suite.h"

#include <box2d/b2_settings.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "elementary_functions.h"

using namespace foldcar;

namespace {

constexpr int kSamples = 300000;

// Unity takes the standard's names.
bool is_nan(double x) { return x != x; }
bool is_infinite(double x) { return std::abs(x) == std::numeric_limits<double>::infinity(); }

// By how many units in the last place of the true value the computed one is wrong.
double error_ulp(double computed, long double expected) {
  const int exponent = std::max(std::ilogb(expected), -1022);
  return static_cast<double>(std::abs((computed - expected) / std::scalbn(1.0L, exponent - 52)));
}

double between(std::mt19937_64& random, double least, double most) {
  return std::uniform_real_distribution<double>(least, most)(random);
}

// Of every magnitude and both signs.
double of_any_size(std::mt19937_64& random, int least_exponent, int most_exponent) {
  const double sign = random() % 2 == 0 ? 1 : -1;
  return sign * std::scalbn(between(random, 1, 2), static_cast<int>(between(random, least_exponent, most_exponent)));
}

}  // namespace

TEST(test_every_function_is_within_its_stated_error) {
  const struct {
    const char* name;
    double limit_ulp;
    std::function<double(std::mt19937_64&)> error_of_sample;
  } kFunctions[] = {
      {"sine and cosine", 1,
       [](std::mt19937_64& random) {
         const double x = random() % 2 == 0 ? between(random, -7, 7) : of_any_size(random, -30, 19);
         return std::max(error_ulp(sine(x), std::sin(static_cast<long double>(x))),
                         error_ulp(cosine(x), std::cos(static_cast<long double>(x))));
       }},
      {"exponential", 1.5,
       [](std::mt19937_64& random) {
         const double x = random() % 2 == 0 ? between(random, -2, 2) : between(random, -708, 709);
         return error_ulp(exponential(x), std::exp(static_cast<long double>(x)));
       }},
      {"arc tangent", kElementaryError_ulp,
       [](std::mt19937_64& random) {
         const double y = of_any_size(random, -30, 30);
         const double x = random() % 2 == 0 ? of_any_size(random, -30, 30) : y * between(random, -3, 3);
         return error_ulp(arc_tangent(y, x), std::atan2(static_cast<long double>(y), static_cast<long double>(x)));
       }},
      {"arc sine and arc cosine", kElementaryError_ulp,
       [](std::mt19937_64& random) {
         const double x = between(random, -1, 1);
         return std::max(error_ulp(arc_sine(x), std::asin(static_cast<long double>(x))),
                         error_ulp(arc_cosine(x), std::acos(static_cast<long double>(x))));
       }},
      {"hypotenuse", kElementaryError_ulp,
       [](std::mt19937_64& random) {
         const double x = of_any_size(random, -600, 600), y = x * between(random, -4, 4);
         return error_ulp(hypotenuse(x, y), std::hypot(static_cast<long double>(x), static_cast<long double>(y)));
       }},
      // Computed with more bits than a float has: the rounded result is nearly always the nearest float.
      {"Box2D's sine and cosine, in units of a float", 0.501,
       [](std::mt19937_64& random) {
         const auto x = static_cast<float>(between(random, -1000, 1000));
         return std::max(error_ulp(sinf(x), std::sin(static_cast<long double>(x))),
                         error_ulp(cosf(x), std::cos(static_cast<long double>(x)))) * std::scalbn(1.0, -29);
       }},
  };
  for (const auto& function : kFunctions) {
    std::mt19937_64 random(1);
    double most = 0;
    for (int i = 0; i < kSamples; ++i) most = std::max(most, function.error_of_sample(random));
    TEST_ASSERT_TRUE_MESSAGE(most <= function.limit_ulp, function.name);
  }
}

TEST(test_sine_and_cosine_are_exact_to_the_bit_count_next_to_their_zeros) {
  double error = 0;
  for (int quarter = 1; quarter < 600000; ++quarter) {
    const double x = quarter * 1.5707963267948966;
    const long double s = std::sin(static_cast<long double>(x)), c = std::cos(static_cast<long double>(x));
    // The reference itself is reduced by 66 bits of pi: only its absolute error is known.
    error = std::max(error, std::abs(static_cast<double>(sine(x) - s)));
    error = std::max(error, std::abs(static_cast<double>(cosine(x) - c)));
  }
  TEST_ASSERT_DOUBLE_WITHIN(1.2e-16, 0, error);
}

TEST(test_large_angles_give_a_point_of_the_unit_circle) {
  for (const double x : {1e7, -3e12, 1e100, std::numeric_limits<double>::max()}) {
    TEST_ASSERT_DOUBLE_WITHIN(4e-16, 1, sine(x) * sine(x) + cosine(x) * cosine(x));
  }
}

TEST(test_special_values_are_those_of_the_standard) {
  const double infinity = std::numeric_limits<double>::infinity(), nan = std::nan("");
  for (const double x : {infinity, -infinity, nan}) {
    TEST_ASSERT_TRUE(is_nan(sine(x)));
    TEST_ASSERT_TRUE(is_nan(cosine(x)));
  }
  TEST_ASSERT_TRUE(std::signbit(sine(-0.0)));
  TEST_ASSERT_EQUAL_DOUBLE(1, cosine(0));
  TEST_ASSERT_EQUAL_DOUBLE(1, exponential(0));
  TEST_ASSERT_EQUAL_DOUBLE(0, exponential(-1000));
  TEST_ASSERT_EQUAL_DOUBLE(0, exponential(-infinity));
  TEST_ASSERT_TRUE(is_infinite(exponential(1000)));
  TEST_ASSERT_TRUE(is_nan(exponential(nan)));
  TEST_ASSERT_TRUE(is_nan(arc_sine(1.5)));
  TEST_ASSERT_EQUAL_DOUBLE(M_PI, arc_tangent(0.0, -0.0));
  TEST_ASSERT_EQUAL_DOUBLE(-M_PI, arc_tangent(-0.0, -1));
  TEST_ASSERT_EQUAL_DOUBLE(M_PI_2, arc_tangent(1, 0));
  TEST_ASSERT_EQUAL_DOUBLE(3 * M_PI_4, arc_tangent(infinity, -infinity));
  TEST_ASSERT_EQUAL_DOUBLE(0, hypotenuse(0, 0));
  TEST_ASSERT_TRUE(is_nan(hypotenuse(nan, 0)));
  TEST_ASSERT_TRUE(is_infinite(hypotenuse(nan, infinity)));
}

TEST(test_sine_and_cosine_of_one_reduction_have_the_bits_of_each_alone) {
  int differing = 0;
  std::mt19937_64 random(1);
  for (int i = 0; i < kSamples / 2; ++i) {
    const double x = i == 0 ? -0.0 : of_any_size(random, -40, 30);
    const auto [s, c] = sine_and_cosine(x);
    differing += s == sine(x) && c == cosine(x) && std::signbit(s) == std::signbit(sine(x)) ? 0 : 1;
  }
  TEST_ASSERT_EQUAL(0, differing);
}
