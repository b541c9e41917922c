// The firmware as the hardware layer sees it: a set-up and a pass of the main program, repeated for ever.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {
namespace firmware {

// What the board knows of its last start.
struct Boot {
    uint32_t count;  // differs at every boot
    wire::Reset cause;
    bool was_enabled;  // the drivers, when the reset came
};

// The low 16 bits of `now_ticks` are the timer's, read less than 65,536 ticks ago. Interrupts are still off.
void set_up(const Boot& boot, uint32_t now_ticks);

// One bounded pass: motion first, then one piece of work: a reply, a segment, or a few received bytes.
void pass();

}  // namespace firmware
}  // namespace planarm
