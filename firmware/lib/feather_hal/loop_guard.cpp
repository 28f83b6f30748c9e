#include "loop_guard.h"

// First, as the SDK's other headers want it.
#include <freertos/FreeRTOS.h>

#include <esp_attr.h>
#include <esp_freertos_hooks.h>
#include <esp_private/system_internal.h>
#include <esp_system.h>
#include <freertos/task.h>
#include <freertos/xtensa_context.h>
#include <soc/cpu.h>

#include "crash_memory.h"

namespace foldcar {
namespace {

static_assert(configTICK_RATE_HZ == 1000, "a tick is a millisecond");

// Of this core only: loop() writes them, its tick interrupt counts them down.
volatile std::uint32_t left_ms = 0;  // until loop() stands still for too long; 0: it is not guarded
TaskHandle_t loop_task = nullptr;

// Where loop() was when it was interrupted, or went to sleep. The first word of a task is the top of its stack; there lies
// the frame with its registers: a whole one if it was interrupted, else a small one, which has no number of an exit.
IRAM_ATTR StackPlace place_of(TaskHandle_t task) {
  const void* top = *reinterpret_cast<const void* const*>(task);
  const auto& interrupted = *static_cast<const XtExcFrame*>(top);
  if (interrupted.exit != 0) {
    return {static_cast<std::uint32_t>(interrupted.pc), static_cast<std::uint32_t>(interrupted.a1),
            static_cast<std::uint32_t>(interrupted.a0)};
  }
  const auto& asleep = *static_cast<const XtSolFrame*>(top);
  return {esp_cpu_process_stack_pc(static_cast<std::uint32_t>(asleep.pc)), static_cast<std::uint32_t>(asleep.a1),
          static_cast<std::uint32_t>(asleep.a0)};
}

// In RAM, as flash may be off.
IRAM_ATTR void count_down() {
  const std::uint32_t now_left_ms = left_ms;
  if (now_left_ms == 0) return;
  left_ms = now_left_ms - 1;
  if (now_left_ms > 1) return;
  CrashReport report;
  trace_callers(place_of(loop_task), report);
  keep_crash(report);
  esp_reset_reason_set_hint(ESP_RST_TASK_WDT);
  esp_system_abort(DRAM_STR("loop() stands still"));
}

}  // namespace

bool LoopGuard::begin() {
  loop_task = xTaskGetCurrentTaskHandle();
  left_ms = 0;
  return esp_register_freertos_tick_hook(count_down) == ESP_OK;
}

void LoopGuard::feed(bool is_driving) { left_ms = is_driving ? kDrivingMs : kStandingMs; }

}  // namespace foldcar
