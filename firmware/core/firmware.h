// The firmware as the hardware layer sees it: a set-up and a pass of the main program, repeated for ever.
#pragma once

#include <stdint.h>

namespace planarm {
namespace firmware {

// `boot_count` differs at every boot. Interrupts are still off.
void set_up(uint32_t boot_count);

// One bounded pass: motion first, then a few received bytes or one segment, then a reply.
void pass();

}  // namespace firmware
}  // namespace planarm
