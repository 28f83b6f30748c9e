// A suite's tests run where they are defined, in the order of their lines: TEST(name) { … }, without a list to forget one in.
#pragma once

#include <vector>

// Behind the standard's headers: it hides std::isnan behind a macro.
#include <unity.h>

namespace foldcar {

struct RegisteredTest {
  void (*run)();
  const char* name;
  const char* file;
  int line;
};

inline std::vector<RegisteredTest>& registered_tests() {
  static std::vector<RegisteredTest> tests;
  return tests;
}

inline bool registered(const RegisteredTest& test) {
  registered_tests().push_back(test);
  return true;
}

}  // namespace foldcar

#define TEST(name)                                                                                        \
  static void name();                                                                                     \
  [[maybe_unused]] static const bool name##_is_run = foldcar::registered({name, #name, __FILE__, __LINE__}); \
  static void name()

// Weak, as every file of a suite has them.
extern "C" __attribute__((weak)) void setUp() {}
extern "C" __attribute__((weak)) void tearDown() {}

__attribute__((weak)) int main() {
  UNITY_BEGIN();
  for (const foldcar::RegisteredTest& test : foldcar::registered_tests()) {
    UnitySetTestFile(test.file);
    UnityDefaultTestRun(test.run, test.name, test.line);
  }
  return UNITY_END();
}
