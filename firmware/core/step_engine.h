// Makes the step pulses. Each joint owns a compare channel and a small ring of runs; a rising edge is always
// made by the compare match on its scheduled tick, the falling edge by the interrupt of that match.
//
// Two sides share a ring: the main program appends runs and takes executed ones back, the step interrupt
// works on `active` and moves on along `next`. The interrupt alone goes on to a run marked `chained`; before
// any other it leaves the joint idle, and the main program starts it again when it is due.
#pragma once

#include <stdint.h>

#include "hal_step_timer.h"
#include "segment.h"

namespace planarm {

// Whether the interrupt may go on to a run by itself, and whether DIR changes for it.
enum class Chain : uint8_t { NONE = 0, ONWARD = 1, REVERSED = 2 };

// Steps of one joint in one direction, as the step interrupt works them off.
struct Run {
    uint32_t interval_q16;  // from the current step to the next
    uint32_t add_q16;       // what the next interval has more, modulo 2^32
    uint16_t fraction;      // of the current step's tick, in 2^-16
    uint16_t steps_left;    // the current step included
    uint32_t first_ticks;   // tick of the first step on the 32-bit clock
    Run* next;
    uint16_t steps;
    bool positive;
    volatile Chain chained;  // written last
};

struct StepJoint {
    Run* volatile active;  // the run in progress, or the next one
};

extern StepJoint step_joints[wire::JOINTS];
extern volatile bool step_missed;  // a step came too late to be placed; both joints are disarmed

namespace step_engine {

// Distance that an edge must still have when it is placed: the low time, which also covers the way to the
// arming write.
constexpr uint16_t STEP_MARGIN_TICKS = wire::MIN_STEP_LOW_TICKS;
// The same after a change of DIR.
constexpr uint16_t DIR_MARGIN_TICKS = wire::MIN_DIR_SETUP_TICKS;

struct Position {
    uint16_t counter;  // the timer at the moment the position is told for
    int32_t usteps[wire::JOINTS];
};

// Back to rest with empty rings; positions 0. For start-up, before interrupts are on.
void reset();

// True while `joint` can take another run.
bool has_room(uint8_t joint);

// Appends the run of `move` that starts at `start_ticks`; has_room must hold.
void append(uint8_t joint, const Move& move, uint32_t start_ticks);

// Starts idle joints whose next run is due soon and takes executed runs back. False when a step came too
// late.
bool serve(uint32_t now_ticks);

// True from a missed step to the stop that follows.
inline bool missed() { return step_missed; }

// Stops both joints at once and drops all runs. Steps that have risen are counted.
void stop();

// Signed steps since start-up at this instant, a pulse that is still high included.
Position position();

// Counts the step that has just risen and places the next one: the step interrupt in plain C++. The native
// board runs it; hal/uno/step_interrupts.cpp does the same, statement by statement, in assembler.
template <uint8_t JOINT>
HAL_INLINE void on_match() {
    Run* const run = step_joints[JOINT].active;
    const uint16_t left = static_cast<uint16_t>(run->steps_left - 1);
    run->steps_left = left;
    if (left != 0) {
        const uint32_t ahead = run->interval_q16 + run->fraction;
        run->fraction = static_cast<uint16_t>(ahead);
        const uint16_t ahead_ticks = static_cast<uint16_t>(ahead >> 16);
        const uint16_t edge = static_cast<uint16_t>(hal::step_edge<JOINT>() + ahead_ticks);
        hal::step_set_edge<JOINT>(edge);
        hal::step_fall<JOINT>();
        const uint16_t remaining = static_cast<uint16_t>(edge - hal::counter());
        if (static_cast<uint16_t>(remaining - STEP_MARGIN_TICKS) < ahead_ticks) {
            hal::step_arm<JOINT>();
            hal::compiler_barrier();  // reading the interval again costs less than saving registers for it
            run->interval_q16 += run->add_q16;
            return;
        }
    } else {
        Run* const next = run->next;
        step_joints[JOINT].active = next;
        const Chain chained = next->chained;
        if (chained == Chain::NONE) {
            hal::step_fall<JOINT>();
            hal::step_interrupt_off<JOINT>();
            return;
        }
        const uint16_t edge = static_cast<uint16_t>(next->first_ticks);
        hal::step_set_edge<JOINT>(edge);
        hal::step_fall<JOINT>();
        const bool reversed = chained == Chain::REVERSED;
        if (reversed) hal::dir_write<JOINT>(next->positive);
        const uint16_t margin = reversed ? DIR_MARGIN_TICKS : STEP_MARGIN_TICKS;
        const uint16_t remaining = static_cast<uint16_t>(edge - hal::counter());
        if (static_cast<uint16_t>(remaining - margin) <= MAX_AHEAD_TICKS) {
            hal::step_arm<JOINT>();
            return;
        }
    }
    hal::steps_off();
    step_missed = true;
}

}  // namespace step_engine
}  // namespace planarm
