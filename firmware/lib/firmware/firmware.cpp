#include "firmware.h"

#include <algorithm>

#include "led.h"

namespace foldcar {

namespace {

// A loop that comes round this late (µs) has left its input waiting. Writing to flash takes up to about 0.2 s; after 0.8 s
// the board restarts (loop_guard.h).
constexpr std::uint64_t kLateUs = 500000;

}  // namespace

Firmware::Firmware(const Hal& hal, const char* build)
    : hal_(hal), application_(hal, parameters_), link_(hal, application_, loop_, build) {}

void Firmware::begin(const DesignResult& design) {
  application_.begin(design);
  link_.discard();
  deadline_us_ = polled_us_ = hal_.clock.now_us();
}

// One round of the loop: reads the link, ticks if a tick is due, and sends.
void Firmware::poll() {
  const std::uint64_t now_us = hal_.clock.now_us();
  link_.receive(now_us - polled_us_ > kLateUs);
  polled_us_ = now_us;
  if (now_us >= deadline_us_) tick(now_us);
  link_.flush();
}

// One tick of application and link, timed. The next deadline counts from the last one, so that the ticks do not drift;
// missed ticks are counted, not made up for. Restarts the board if that is due.
void Firmware::tick(std::uint64_t now_us) {
  deadline_us_ += kTickUs;
  if (deadline_us_ <= now_us) {
    const std::uint64_t missed = (now_us - deadline_us_) / kTickUs + 1;
    loop_.missed_count += static_cast<std::uint32_t>(missed);
    deadline_us_ += missed * kTickUs;
  }
  application_.tick();
  link_.run();
  hal_.board.set_led(led_is_on(application_.status().state, link_.log_state(), now_us));
  ++loop_.tick_count;
  loop_.last_us = static_cast<std::uint32_t>(hal_.clock.now_us() - now_us);
  loop_.worst_us = std::max(loop_.worst_us, loop_.last_us);
  if (!link_.restart_is_due()) return;
  link_.flush();
  hal_.board.restart();
}

}  // namespace foldcar
