// The servo driver: what leaves its outputs, from the registers of its chip, and what is told of a bus that fails.
#include "../suite.h"

#include <esp_private/panic_internal.h>
#include <freertos/xtensa_context.h>

#include <cmath>

#include "feather_bench.h"

using namespace foldcar;

extern "C" void __wrap_esp_panic_handler(panic_info_t* info);
extern "C" [[noreturn]] void __wrap_esp_restart_noos();

static PulsesUs pulse_on(std::size_t channel, float pulse_us) {
  PulsesUs pulses_us{};
  pulses_us[channel] = pulse_us;
  return pulses_us;
}

TEST(the_bus_runs_at_400_khz_on_its_pins_and_gives_up_after_5_ms) {
  BegunBench bench;
  TEST_ASSERT_EQUAL_INT(23, fake_esp32.i2c.sda);
  TEST_ASSERT_EQUAL_INT(22, fake_esp32.i2c.scl);
  TEST_ASSERT_EQUAL_UINT32(400000, fake_esp32.i2c.clock_hz);
  TEST_ASSERT_EQUAL_UINT16(5, fake_esp32.i2c.time_out_ms);
}

// Whatever the oscillator, each pulse is right within half a tick, and the rate within the prescaler's half step.
TEST(a_pulse_has_its_width_within_half_a_tick_at_any_oscillator) {
  for (const float oscillator_hz : {23e6f, 24.06e6f, 25e6f, 26.3e6f, 27e6f}) {
    FeatherBench bench;
    bench.begin(oscillator_hz);
    TEST_ASSERT_FLOAT_WITHIN(100.0f, 20000.0f, static_cast<float>(bench.servo_chip.period_us()));
    TEST_ASSERT_TRUE(bench.servo_chip.tick_us() < 4.91);
    for (float pulse_us = 1000.0f; pulse_us <= 2000.0f; pulse_us += 7.3f) {
      TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(pulse_on(3, pulse_us)));
      const double error_us = bench.servo_chip.pulse_us(3) - static_cast<double>(pulse_us);
      TEST_ASSERT_TRUE(std::fabs(error_us) <= 0.5 * bench.servo_chip.tick_us() + 1e-3);
    }
  }
}

TEST(every_output_has_its_own_pulse_or_none) {
  BegunBench bench;
  PulsesUs pulses_us{1000.0f, kNoPulse, 1500.0f, 2000.0f, kNoPulse, kNoPulse, 1234.5f, 1800.0f};
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(pulses_us));
  for (std::size_t channel = 0; channel < 16; ++channel) {
    const float expected_us = channel < kChannelCount ? pulses_us[channel] : kNoPulse;
    TEST_ASSERT_FLOAT_WITHIN(2.5f, expected_us, static_cast<float>(bench.servo_chip.pulse_us(channel)));
  }
  const std::size_t before = bench.servo_chip.transmissions.size();
  for (const float wrong_us : {-1.0f, 3001.0f, NAN}) {
    TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(pulse_on(1, wrong_us)));
  }
  TEST_ASSERT_EQUAL_UINT_MESSAGE(before, bench.servo_chip.transmissions.size(), "a wrong pulse leaves them as they are");
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(PulsesUs{}));
  for (std::size_t channel = 0; channel < 16; ++channel) TEST_ASSERT_TRUE(bench.servo_chip.pulse_us(channel) == 0);
  TEST_ASSERT_TRUE_MESSAGE(fake_esp32.pin_levels.empty() && fake_esp32.timers.empty(), "output enable is not wired");
}

TEST(a_write_to_a_bus_that_fails_is_told) {
  BegunBench bench;
  fake_esp32.i2c.bus_hangs = true;
  TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
  TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(PulsesUs{}));
  fake_esp32.i2c.bus_hangs = false;
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(PulsesUs{}));
  fake_esp32.i2c.chips.erase(0x40);
  TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
  TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(PulsesUs{}));
  TEST_ASSERT_FALSE(bench.hal.servos.set_oscillator_hz(25e6f));
  fake_esp32.i2c.chips[0x40] = &bench.servo_chip;
  TEST_ASSERT_FALSE_MESSAGE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)), "the rate is no longer known");
}

// As when flash is erased, which stops both cores in the middle of a transfer.
TEST(one_transfer_that_fails_is_repeated) {
  BegunBench bench(true);
  fake_esp32.i2c.fails_at = 0;
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(pulse_on(7, 1700.0f)));
  TEST_ASSERT_EQUAL_INT_MESSAGE(-1, fake_esp32.i2c.fails_at, "none has failed");
  TEST_ASSERT_FLOAT_WITHIN(2.5f, 1700.0f, static_cast<float>(bench.servo_chip.pulse_us(7)));
  fake_esp32.i2c.fails_at = 0;
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(PulsesUs{}));
  TEST_ASSERT_TRUE(bench.servo_chip.pulse_us(7) == 0);
  fake_esp32.i2c.fails_at = 0;
  ImuSample sample;
  TEST_ASSERT_TRUE(bench.hal.imu.read(sample));
  TEST_ASSERT_FLOAT_WITHIN(0.01f, 9.81f, sample.acceleration_m_s2[2]);
}

TEST(all_outputs_change_in_one_transfer) {
  BegunBench bench;
  const std::size_t before = bench.servo_chip.transmissions.size();
  PulsesUs pulses_us;
  pulses_us.fill(1500.0f);
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(pulses_us));
  TEST_ASSERT_EQUAL_UINT(before + 1, bench.servo_chip.transmissions.size());
}

// The chip, or the bus, was not there at the start; nothing is set up, even if it answers later.
TEST(a_chip_that_was_missing_at_the_start_takes_no_writes) {
  for (const bool bus_fails : {false, true}) {
    FeatherBench bench;
    fake_esp32.i2c.chips.clear();
    fake_esp32.i2c.driver_fails = bus_fails;
    TEST_ASSERT_FALSE(bench.hal.servos.begin());
    fake_esp32.i2c.chips[0x40] = &bench.servo_chip;
    TEST_ASSERT_FALSE(bench.hal.servos.set_oscillator_hz(25e6f));
    TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
    TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(PulsesUs{}));
    TEST_ASSERT_FALSE(bench.servo_chip.has_driven);
  }
}

TEST(no_pulse_is_written_before_the_oscillator_is_known) {
  FeatherBench bench;
  TEST_ASSERT_TRUE(bench.hal.servos.begin());
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(PulsesUs{}));
  TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
}

// The library checks none of its transfers. Whichever of them fails while the rate is set, pulses are right or refused.
TEST(a_transfer_that_fails_while_the_rate_is_set_never_leads_to_wrong_pulses) {
  int refused_count = 0;
  for (int transfer = 0; transfer < 12; ++transfer) {
    FeatherBench bench;
    TEST_ASSERT_TRUE(bench.hal.servos.begin());
    fake_esp32.i2c.fails_at = transfer;
    const bool confirmed = bench.hal.servos.set_oscillator_hz(25e6f);
    fake_esp32.i2c.fails_at = -1;
    TEST_ASSERT_TRUE(confirmed == bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
    if (confirmed) TEST_ASSERT_FLOAT_WITHIN(2.5f, 1500.0f, static_cast<float>(bench.servo_chip.pulse_us(0)));
    refused_count += confirmed ? 0 : 1;
  }
  TEST_ASSERT_TRUE(refused_count >= 3);  // off, sleep, prescaler
}

// With a wire, pulses end when they are turned off, and 150 ms after the last write of a loop that hangs.
TEST(output_enable_is_low_only_while_pulses_are_written) {
  TEST_ASSERT_EQUAL_UINT64(150000, OutputGate::kHoldUs);  // docs/firmware.md
  BegunBench bench;
  TEST_ASSERT_TRUE(bench.hal.servos.use_output_enable());
  const int& level = fake_esp32.pin_levels[27];
  TEST_ASSERT_EQUAL_INT(HIGH, level);
  for (int tick = 0; tick < 50; ++tick) {
    TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
    pass_fake_time(20000);
    TEST_ASSERT_EQUAL_INT(LOW, level);
  }
  pass_fake_time(static_cast<std::int64_t>(OutputGate::kHoldUs) - 20001);
  TEST_ASSERT_EQUAL_INT(LOW, level);
  pass_fake_time(1);
  TEST_ASSERT_EQUAL_INT(HIGH, level);
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
  TEST_ASSERT_EQUAL_INT(LOW, level);
  fake_esp32.i2c.bus_hangs = true;
  TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(PulsesUs{}));
  TEST_ASSERT_EQUAL_INT_MESSAGE(HIGH, level, "the pulses end although the driver does not answer");
}

// Notes output enable's level while the chip is written to.
struct GatedChip : FakePca9685 {
  std::vector<int> levels;
  bool write(const std::vector<std::uint8_t>& bytes) override {
    levels.push_back(fake_esp32.pin_levels[27]);
    return FakePca9685::write(bytes);
  }
};

TEST(pulses_are_let_through_after_they_are_written_and_held_back_before_they_are_turned_off) {
  BegunBench bench;
  GatedChip chip;
  for (const auto& bytes : bench.servo_chip.transmissions) chip.write(bytes);
  fake_esp32.i2c.chips[0x40] = &chip;
  TEST_ASSERT_TRUE(bench.hal.servos.use_output_enable());
  const int& level = fake_esp32.pin_levels[27];
  chip.levels.clear();
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
  TEST_ASSERT_EQUAL_INT(HIGH, chip.levels.at(0));
  TEST_ASSERT_EQUAL_INT(LOW, level);
  TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(PulsesUs{}));
  TEST_ASSERT_EQUAL_INT(HIGH, chip.levels.at(1));
  fake_esp32.i2c.bus_hangs = true;
  TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
  TEST_ASSERT_EQUAL_INT_MESSAGE(HIGH, level, "pulses that may be wrong are not let through");
}

static int level_in_the_sdks_handler = LOW;
extern "C" void __real_esp_panic_handler(panic_info_t*) { level_in_the_sdks_handler = fake_esp32.pin_levels[27]; }

extern "C" [[noreturn]] void __real_esp_restart_noos() { throw FakeRestart(); }

// The SDK's handler prints and restarts the processors, which leaves the pins as they are.
TEST(a_crash_and_a_dip_of_the_supply_end_the_pulses_first) {
  for (const bool crashes : {true, false}) {
    BegunBench bench;
    TEST_ASSERT_TRUE(bench.hal.servos.use_output_enable());
    TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
    TEST_ASSERT_EQUAL_INT(LOW, fake_esp32.pin_levels[27]);
    if (crashes) {
      const XtExcFrame frame{};
      panic_info_t info{&frame, false};
      __wrap_esp_panic_handler(&info);
      TEST_ASSERT_EQUAL_INT(HIGH, level_in_the_sdks_handler);
    } else {
      try {
        __wrap_esp_restart_noos();
      } catch (const FakeRestart&) {
      }
    }
    TEST_ASSERT_EQUAL_INT(HIGH, fake_esp32.pin_levels[27]);
  }
}

// Without it nothing would end the pulses of a loop that hangs.
TEST(a_gate_whose_timer_does_not_start_lets_no_pulse_through) {
  for (const bool was_open : {false, true}) {
    BegunBench bench;
    TEST_ASSERT_TRUE(bench.hal.servos.use_output_enable());
    if (was_open) {
      TEST_ASSERT_TRUE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
      TEST_ASSERT_EQUAL_INT(LOW, fake_esp32.pin_levels[27]);
    }
    fake_esp32.timers_fail = true;
    TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
    TEST_ASSERT_EQUAL_INT(HIGH, fake_esp32.pin_levels[27]);
  }
}

TEST(without_a_timer_output_enable_stays_high_and_no_pulse_is_written) {
  BegunBench bench;
  fake_esp32.heap_is_full = true;
  TEST_ASSERT_FALSE(bench.hal.servos.use_output_enable());
  TEST_ASSERT_FALSE(bench.hal.servos.write_pulses(pulse_on(0, 1500.0f)));
  TEST_ASSERT_EQUAL_INT(HIGH, fake_esp32.pin_levels[27]);
}
