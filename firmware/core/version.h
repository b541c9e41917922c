// The firmware's own version, told in WELCOME.
#pragma once

#include <stdint.h>

namespace planarm {

constexpr uint8_t VERSION_MAJOR = 0;
constexpr uint8_t VERSION_MINOR = 1;
constexpr uint8_t VERSION_PATCH = 0;

}  // namespace planarm
