// The 32-bit tick clock: the timer's 16 bits, carried on by the main program. It wraps after 268 s; times are
// compared by their difference, as int32_t.
//
// A motion that was frozen goes on with its own times: its clock has stood meanwhile, by whole laps of the
// timer, so that the low 16 bits of all its times are the timer's still. Times are the motion's where nothing
// else is said; the device's clock never stands.
#pragma once

#include <stdint.h>

namespace planarm {
namespace clock {

// Sets the clock to `ticks`, whose low 16 bits must be the timer's. For start-up.
void reset(uint32_t ticks);

// The 32-bit time of a reading of the timer less than 65,536 ticks (4.1 ms) after the last time that was
// told.
uint32_t extend(uint16_t counter);

// Looks at the clock for a pass of the main program: what follows are that moment's, for all that the pass
// does or until it looks again. Right as long as it is done once a second; the watchdog comes earlier. Never
// with interrupts off: a lap that is due would be waited for without end.
void begin_pass();
// The same for a time that was told.
void begin_pass_at(uint32_t ticks);
// That moment by the device's clock, and what its clock tells at a time of the motion's.
uint32_t pass_ticks();
uint32_t device_ticks(uint32_t ticks);
// Ticks until then; below 0 when that is past.
int32_t ticks_until(uint32_t ticks);
inline bool has_come(uint32_t ticks) { return ticks_until(ticks) <= 0; }

// Sets the motion's clock back, as if it had stood, so far that `ticks` is less than a lap away.
void stand_before(uint32_t ticks);
// Sets it to the device's again.
void end_standing();

}  // namespace clock
}  // namespace planarm
