#include "background_task.h"

#include <freertos/FreeRTOS.h>
#include <freertos/task.h>

#include <cstdint>

namespace foldcar {
namespace {

constexpr std::uint32_t kStackSize = 8192;  // bytes; as much as loop() has
// The idle tasks' priority, so that they take turns with it: the watchdog guards the idle task of core 0.
constexpr UBaseType_t kPriority = tskIDLE_PRIORITY;
constexpr BaseType_t kCore = 0;  // loop() runs on core 1
constexpr TickType_t kShortPause = 1;
constexpr TickType_t kLongPause = pdMS_TO_TICKS(20);

struct Work {
  bool (*step)(void*);
  void* context;
};

void run(void* argument) {
  const Work& work = *static_cast<const Work*>(argument);
  for (;;) vTaskDelay(work.step(work.context) ? kShortPause : kLongPause);
}

}  // namespace

bool start_background_task(bool (*step)(void*), void* context) {
  static Work work;
  work = {step, context};
  return xTaskCreatePinnedToCore(run, "background", kStackSize, &work, kPriority, nullptr, kCore) == pdPASS;
}

}  // namespace foldcar
