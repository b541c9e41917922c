// The 32-bit tick clock: the timer's 16 bits, carried on by the main program. It wraps after 268 s; times are
// compared by their difference, as int32_t.
#pragma once

#include <stdint.h>

namespace planarm {
namespace clock {

// Sets the clock to `ticks`, whose low 16 bits must be the timer's. For start-up.
void reset(uint32_t ticks);

// The 32-bit time of a reading of the timer. Right as long as one is made in every 65,536 ticks (4.1 ms).
uint32_t extend(uint16_t counter);

// Ticks now.
uint32_t now();

// Looks at the clock for a pass of the main program: what follows are that moment's, for all that the pass
// does.
void begin_pass();
uint32_t pass_ticks();
// Ticks until then; below 0 when that is past.
int32_t ticks_until(uint32_t ticks);
inline bool has_come(uint32_t ticks) { return ticks_until(ticks) <= 0; }

}  // namespace clock
}  // namespace planarm
