// Fake of ESP-IDF 4.4: a task, which runs when a test lets it, up to its next delay.
#pragma once

#include "../fake_esp32.h"
#include "FreeRTOS.h"

using TaskFunction_t = void (*)(void*);
using TaskHandle_t = void*;

constexpr UBaseType_t tskIDLE_PRIORITY = 0;

// Stack in bytes. The code it returns if there is no memory is another than pdPASS.
inline BaseType_t xTaskCreatePinnedToCore(TaskFunction_t function, const char*, std::uint32_t stack_size, void* argument,
                                          UBaseType_t priority, TaskHandle_t*, BaseType_t core) {
  if (fake_esp32.heap_is_full) return -1;
  fake_esp32.task = {function, argument, stack_size, priority, core, 0};
  return pdPASS;
}

// The task that runs loop(). As FreeRTOS's, it begins with the top of its stack.
inline TaskHandle_t xTaskGetCurrentTaskHandle() { return &fake_esp32.loop_stack_top; }

struct FakeDelay {};

inline void vTaskDelay(TickType_t ticks) {
  fake_esp32.task.delay_ms = ticks;
  throw FakeDelay();
}

// Enters the task's function and leaves it at its delay, as a task whose loop has no state can be run.
inline void run_fake_task() {
  if (fake_esp32.task.function == nullptr) return;
  try {
    fake_esp32.task.function(fake_esp32.task.argument);
  } catch (const FakeDelay&) {
  }
}
