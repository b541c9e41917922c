// The 32-bit tick clock: the timer's 16 bits, carried on by the main program. It wraps after 268 s; times are
// compared by their difference, as int32_t.
#pragma once

#include <stdint.h>

namespace planarm {
namespace clock {

// Sets the clock to `ticks`, whose low 16 bits must be the timer's. For start-up.
void reset(uint32_t ticks);

// Ticks now. Right as long as it is asked for once a second; the watchdog comes earlier. Never with
// interrupts off: a lap that is due would be waited for without end.
uint32_t now();

// The 32-bit time of a reading of the timer less than 65,536 ticks (4.1 ms) after the last time that was
// told.
uint32_t extend(uint16_t counter);

// Looks at the clock for a pass of the main program: what follows are that moment's, for all that the pass
// does or until it looks again.
void begin_pass();
// The same for a time that was told.
void begin_pass_at(uint32_t ticks);
uint32_t pass_ticks();
// Ticks until then; below 0 when that is past.
int32_t ticks_until(uint32_t ticks);
inline bool has_come(uint32_t ticks) { return ticks_until(ticks) <= 0; }

}  // namespace clock
}  // namespace planarm
