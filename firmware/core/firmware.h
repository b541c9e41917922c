// The firmware as the hardware layer sees it: a set-up and a pass of the main program, repeated for ever.
#pragma once

#include <stdint.h>

namespace planarm {
namespace firmware {

// `boot_count` differs at every boot; the low 16 bits of `now_ticks` are the timer's, read less than 65,536
// ticks ago. Interrupts are still off.
void set_up(uint32_t boot_count, uint32_t now_ticks);

// One bounded pass: motion first, then one piece of work: a reply, a segment, or a few received bytes.
void pass();

}  // namespace firmware
}  // namespace planarm
