// Fake of ESP-IDF 4.4: where code and data are kept. Here all is in one memory, which resets leave as it is.
#pragma once

#define IRAM_ATTR
#define RTC_NOINIT_ATTR
#define DRAM_STR(text) (text)
