// Makes the step pulses. Each joint owns a small ring of runs. Where the board's wiring has a joint on a
// compare output its rising edge is always made by the match on its scheduled tick, the falling edge by the
// interrupt of that match; elsewhere an interrupt makes both.
//
// Two sides share a ring: the main program appends runs and takes executed ones back, the step interrupt
// works on `active` and moves on along `next`. The interrupt alone goes on to a run marked `chained`; before
// any other it leaves the joint idle, and the main program starts it again when it is due. The steps left of
// the active run are where the interrupt reaches them fastest: hal::steps_left. So may its fraction be.
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
    uint32_t first_ticks;   // tick of the first step on the 32-bit clock
    uint16_t fraction;      // of the current step's tick, in 2^-16
    Run* next;
    uint8_t steps;
    volatile Chain chained;  // written last
    bool positive;           // the position grows
    bool dir_high;
};

// One run more than can be in use, so that a full ring and an empty one differ. The pace that the certificate
// asks for is kept with three (tests/firmware/test_firmware_pace.py).
constexpr uint8_t RING_RUNS = 4;
struct StepJoint {
    Run* volatile active;     // the run in progress, or the next one
    Run* oldest;              // not yet taken back
    Run* free;                // the next to be filled
    int32_t position_usteps;  // of all runs taken back
    bool positive;            // direction of the run appended last
    bool dir_inverted;
    const Run* seen_active;  // when the position was read last
    uint8_t seen_left;       // steps of it that had not risen then
    Run runs[RING_RUNS];     // last: see FrameReceiver
};

extern StepJoint step_joints[wire::JOINTS];
// Not 0 after a step that came too late to be placed: all joints are disarmed, and these interrupts were on
// (hal::step_interrupt_mask), or STEP_MISSED_AT_START.
extern volatile uint8_t step_missed;
constexpr uint8_t STEP_MISSED_AT_START = 0x80;

namespace step_engine {

// Most steps of one run.
constexpr uint8_t MAX_RUN_STEPS = 255;

// Distance that an edge must still have when the interrupt looks at the timer.
constexpr uint16_t STEP_MARGIN_TICKS = hal::STEP_MARGIN_TICKS;
// The same after a change of DIR.
constexpr uint16_t DIR_MARGIN_TICKS = wire::MIN_DIR_SETUP_TICKS;

struct Position {
    uint16_t counter;  // the timer at the moment the position is told for
    int32_t usteps[wire::JOINTS];
};

// Back to rest with empty rings; positions 0. For start-up, before interrupts are on.
void reset();

// True while `joint` can take another run. Takes executed ones back.
bool has_room(uint8_t joint);

// True when all runs are executed.
bool is_idle();

// The run to be appended next, to be filled: all but `next`, `chained` and `dir_high`; has_room must hold.
Run& next_run(uint8_t joint);

// Appends it. `near`: it is close enough to the joint's step before for the step interrupt to go on by
// itself.
void append(uint8_t joint, bool near);

// Sets which level of DIR is the positive direction; the joint must be at rest.
void set_dir_inverted(uint8_t joint, bool inverted);

// Starts idle joints whose next run is due soon. False when a step came too late.
bool serve();

// True from a missed step until its run is dropped.
inline bool missed() { return step_missed != 0; }

// Stops all joints at once and counts the steps that have risen: all up to the tick that is returned, and
// none after it where compare outputs make them.
uint32_t end_steps();

// Drops all runs that are left; all joints must be stopped.
void drop_runs();

// Puts all joints to rest in the middle of what they do, at the tick returned in `now_ticks`; runs keep their
// distance to that tick. False, and nothing is changed, while a step is about to rise or a pulse is high.
bool freeze(uint32_t& now_ticks);

// Signed steps since start-up at this instant, a pulse that is still high included.
Position position();

// Sets the position of a joint without runs.
void set_position(uint8_t joint, int32_t usteps);

}  // namespace step_engine
}  // namespace planarm
