#include "crash_memory.h"

#include <esp_attr.h>
#include <esp_debug_helpers.h>
#include <esp_private/panic_internal.h>
#include <freertos/FreeRTOS.h>
#include <freertos/xtensa_context.h>
#include <soc/cpu.h>
#include <soc/soc_memory_layout.h>

#include <cstddef>

#include "output_gate.h"

namespace foldcar {
namespace {

constexpr std::uint32_t kReportMagic = 0x43524153;

// After a power-on the memory holds anything: a report counts only with its checksum.
struct KeptReport {
  std::uint32_t magic;
  std::uint32_t cause;
  std::uint32_t data_address;
  std::uint32_t addresses[CrashReport::kMaxAddresses];
  std::uint32_t checksum;
};

RTC_NOINIT_ATTR KeptReport kept_report;
// Whether it was kept since the start.
bool is_kept = false;

// FNV-1a over the words before the checksum: http://www.isthe.com/chongo/tech/comp/fnv/
IRAM_ATTR std::uint32_t checksum_of(const KeptReport& report) {
  const auto* words = reinterpret_cast<const std::uint32_t*>(&report);
  std::uint32_t sum = 2166136261u;
  for (std::size_t i = 0; i < offsetof(KeptReport, checksum) / sizeof *words; ++i) sum = (sum ^ words[i]) * 16777619u;
  return sum;
}

}  // namespace

IRAM_ATTR void trace_callers(const StackPlace& place, CrashReport& report) {
  esp_backtrace_frame_t frame{};
  frame.sp = place.sp;
  frame.next_pc = place.return_address;
  report.addresses[0] = place.pc;
  for (std::size_t i = 1; i < CrashReport::kMaxAddresses && frame.next_pc != 0; ++i) {
    // A stack that the crash has destroyed must not crash its handler.
    if (!esp_stack_ptr_is_sane(frame.sp) || !esp_backtrace_get_next_frame(&frame)) return;
    report.addresses[i] = esp_cpu_process_stack_pc(frame.pc);
  }
}

IRAM_ATTR void keep_crash(const CrashReport& report) {
  if (is_kept) return;
  is_kept = true;
  kept_report.magic = kReportMagic;
  kept_report.cause = report.cause;
  kept_report.data_address = report.data_address;
  for (std::size_t i = 0; i < CrashReport::kMaxAddresses; ++i) kept_report.addresses[i] = report.addresses[i];
  kept_report.checksum = checksum_of(kept_report);
}

bool take_crash(CrashReport& report) {
  is_kept = false;
  const bool is_valid = kept_report.magic == kReportMagic && kept_report.checksum == checksum_of(kept_report);
  kept_report.magic = 0;
  if (!is_valid) return false;
  report.cause = static_cast<std::uint8_t>(kept_report.cause);
  report.data_address = kept_report.data_address;
  for (std::size_t i = 0; i < CrashReport::kMaxAddresses; ++i) report.addresses[i] = kept_report.addresses[i];
  return true;
}

}  // namespace foldcar

// In the place of the SDK's, by the linker (platformio.ini): it prints for 0.1 s and restarts the processors. In RAM, because
// flash may be off. First the servo driver's outputs are disabled, as whatever follows may fail.
// NOLINTBEGIN(bugprone-reserved-identifier)
extern "C" void __real_esp_panic_handler(panic_info_t* info);

extern "C" IRAM_ATTR void __wrap_esp_panic_handler(panic_info_t* info) {
  foldcar::OutputGate::disable_output();
  const auto& frame = *static_cast<const XtExcFrame*>(info->frame);
  foldcar::CrashReport report;
  // For what the SDK itself ends, such as an assertion, the processor has no exception of its own.
  if (!g_panic_abort && !info->pseudo_excause) {
    report.cause = static_cast<std::uint8_t>(frame.exccause);
    report.data_address = static_cast<std::uint32_t>(frame.excvaddr);
  }
  foldcar::trace_callers({static_cast<std::uint32_t>(frame.pc), static_cast<std::uint32_t>(frame.a1),
                          static_cast<std::uint32_t>(frame.a0)}, report);
  foldcar::keep_crash(report);
  __real_esp_panic_handler(info);
}
// NOLINTEND(bugprone-reserved-identifier)
