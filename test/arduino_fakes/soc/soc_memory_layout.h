// Fake of ESP-IDF 4.4: whether a stack may be there.
#pragma once

#include <cstdint>

inline bool esp_stack_ptr_is_sane(std::uint32_t sp) { return sp >= 0x3FFAE010u && sp <= 0x3FFFFFF0u && sp % 16 == 0; }
