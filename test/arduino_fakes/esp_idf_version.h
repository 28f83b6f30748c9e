// Fake of ESP-IDF 4.4: its version.
#pragma once

#define ESP_IDF_VERSION_MAJOR 4
