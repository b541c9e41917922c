#include "step_engine.h"

#include "clock.h"
#include "fixed.h"
#include "hal_signals.h"
#include "joints.h"

namespace planarm {

StepJoint step_joints[wire::JOINTS];
volatile uint8_t step_missed;

namespace step_engine {

namespace {

// How far ahead of its first step a joint is started: the 16-bit timer must still tell early from late.
constexpr int32_t START_AHEAD_TICKS = 0x7000;
// A freeze leaves alone a step that is nearer than this: more than its lock takes, in which no step may come.
constexpr uint16_t FREEZE_MARGIN_TICKS = 100 * wire::JOINTS;

constexpr uint8_t twice(uint8_t mask) { return static_cast<uint8_t>(mask << 1); }
constexpr uint8_t half(uint8_t mask) { return static_cast<uint8_t>(mask >> 1); }

// A call takes less code than the product.
[[gnu::noinline]] StepJoint& joint_at(uint8_t joint) { return step_joints[joint]; }

// Moves a position on by steps of a run, modulo 2^32: SET_POSITION takes any.
[[gnu::noinline]] void add_steps(int32_t& position_usteps, const Run& run, uint8_t steps) {
    const uint32_t before = static_cast<uint32_t>(position_usteps);
    position_usteps = static_cast<int32_t>(run.positive ? before + steps : before - steps);
}

void clear(uint8_t joint) {
    StepJoint& ring = joint_at(joint);
    for (uint8_t i = 0; i < RING_RUNS; ++i) {
        ring.runs[i].chained = Chain::NONE;
        ring.runs[i].next = &ring.runs[(i + 1) % RING_RUNS];
    }
    ring.oldest = ring.free = ring.runs;
    ring.active = ring.runs;
}

// Without a lock, as it is asked for between the steps of all joints: what is read twice was not written in
// between.
Run* active_run(const StepJoint& read) {
    Run* seen;
    do {
        seen = read.active;
    } while (seen != read.active);
    return seen;
}

void take_back(uint8_t joint) {
    StepJoint& ring = joint_at(joint);
    const Run* const active = active_run(ring);
    while (ring.oldest != active) {
        ring.oldest->chained = Chain::NONE;
        add_steps(ring.position_usteps, *ring.oldest, ring.oldest->steps);
        ring.oldest = ring.oldest->next;
    }
}

// Places the first edge of an idle joint's next run, which must be `margin` ticks away. False when it is too
// late for it.
[[gnu::noinline]] bool start(uint8_t joint, uint8_t mask, uint16_t edge, uint16_t margin) {
    const hal::InterruptLock lock;
    // Its interrupt may be off because a step has just been missed, or by an emergency.
    if (missed() || hal::has_emergency()) return true;
    hal::step_set_edge(joint, edge);
    hal::step_forget_match(joint, mask);
    if (static_cast<int16_t>(edge - hal::counter() - margin) < 0) return false;
    hal::step_start(joint, mask);
    return true;
}

// Starts a joint whose interrupt is off, so that nobody else writes `active`, when its next run is due. False
// when it is too late for that.
bool start_when_due(uint8_t joint, uint8_t mask) {
    const StepJoint& at = joint_at(joint);
    const Run& run = *at.active;
    if (&run == at.free) return true;
    const int32_t away_ticks = clock::ticks_until(run.first_ticks);
    if (away_ticks > START_AHEAD_TICKS) return true;
    if (away_ticks <= 0) return false;
    uint16_t margin = hal::dir_set(joint, run.dir_high) ? DIR_MARGIN_TICKS : hal::START_MARGIN_TICKS;
    margin = static_cast<uint16_t>(margin + hal::step_early_ticks(joint));
    hal::set_steps_left(joint, run.steps);
    if (hal::FRACTIONS_IN_REGISTERS) hal::set_step_fraction(joint, run.fraction);
    return start(joint, mask, static_cast<uint16_t>(run.first_ticks), margin);
}

// Cuts the executed part off the active run of a joint that had its interrupt on, which is off by now: that
// goes to the position, the rest keeps its distance to the moment, told by both clocks.
[[gnu::noinline]] void cut_active(uint8_t joint, uint32_t now_ticks, uint16_t counter) {
    StepJoint& ring = joint_at(joint);
    Run& run = *ring.active;
    const uint8_t left = hal::steps_left(joint);
    add_steps(ring.position_usteps, run, static_cast<uint8_t>(run.steps - left));
    run.steps = left;
    if (hal::FRACTIONS_IN_REGISTERS) run.fraction = hal::step_fraction(joint);
    run.first_ticks = now_ticks + static_cast<uint16_t>(hal::step_edge(joint) - counter);
    if (left == 0) ring.active = run.next;
}

[[gnu::noinline]] void cut_all(uint8_t were_on, uint32_t now_ticks, uint16_t counter) {
    uint8_t mask = hal::FIRST_MASK;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint, mask = twice(mask)) {
        if ((were_on & mask) != 0) cut_active(joint, now_ticks, counter);
    }
}

// Whether no joint that is on has a pulse that is high, or a step that comes soon. The last joint first: it
// waits longest for others, and is not to wait for the lock besides.
bool may_freeze(uint8_t on, uint16_t counter) {
    const uint8_t high = hal::step_levels_high();
    uint8_t mask = hal::FIRST_MASK << (wire::JOINTS - 1);
    for (uint8_t joint = wire::JOINTS; joint-- != 0; mask = half(mask)) {
        if ((on & mask) == 0) continue;
        // An edge that is past, and whose interrupt is only on its way, is no more than some hundred ticks
        // away.
        const int16_t ahead = static_cast<int16_t>(hal::step_edge(joint) - counter);
        if ((high & mask) != 0 || ahead <= static_cast<int16_t>(FREEZE_MARGIN_TICKS)) return false;
    }
    return true;
}

bool has_seen_active() {
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        const StepJoint& at = joint_at(joint);
        if (at.active != at.seen_active) return false;
    }
    return true;
}

// Looks at what the interrupts change, all as it was when the counter was read: that is returned. A step that
// comes in a lock waits for its end, so what is locked here is what changes at every step, in few
// instructions: 11 cycles on the Uno, with the one behind it. The active runs change with the last step of a
// run only: when they are the same before and after, they were so in between.
uint16_t look(uint8_t& on) {
    uint16_t counter;
    do {
        // Read in this order: a step that is missed in between switches off what is then told by step_missed.
        on = hal::step_interrupts_on();
        on = static_cast<uint8_t>(on | step_missed);
        for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
            StepJoint& at = joint_at(joint);
            at.seen_active = at.active;
        }
        uint8_t left[wire::JOINTS], levels;  // in registers
        {
            const hal::InterruptLock lock;
            for_each_joint([&](auto joint) { left[joint.NUMBER] = hal::steps_left(joint.NUMBER); });
            counter = hal::counter();
            levels = hal::step_levels();
        }
        for_each_joint([&](auto joint) {
            constexpr uint8_t PIN = hal::COMPARE_PINS & hal::FIRST_MASK << joint.NUMBER;
            if ((levels & PIN) != 0) --left[joint.NUMBER];
            step_joints[joint.NUMBER].seen_left = left[joint.NUMBER];
        });
    } while (!has_seen_active());
    return counter;
}

}  // namespace

void reset() {
    step_missed = 0;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        clear(joint);
        StepJoint& ring = joint_at(joint);
        ring.position_usteps = 0;
        ring.dir_inverted = false;
    }
}

// Executed runs are taken back only when their room is needed.
bool has_room(uint8_t joint) {
    const StepJoint& ring = joint_at(joint);
    if (ring.free->next != ring.oldest) return true;
    take_back(joint);
    return ring.free->next != ring.oldest;
}

bool is_idle() {
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        const StepJoint& ring = joint_at(joint);
        if (active_run(ring) != ring.free) return false;
    }
    return true;
}

Run& next_run(uint8_t joint) { return *joint_at(joint).free; }

void append(uint8_t joint, bool near) {
    StepJoint& ring = joint_at(joint);
    Run& run = *ring.free;
    run.dir_high = run.positive != ring.dir_inverted;
    Chain chain = Chain::NONE;
    if (near) chain = run.positive == ring.positive ? Chain::ONWARD : Chain::REVERSED;
    ring.positive = run.positive;
    hal::compiler_barrier();
    run.chained = chain;
    ring.free = run.next;
}

bool serve() {
    // Read in this order: those that a missed step has switched off are not to be started.
    const uint8_t on = hal::step_interrupts_on();
    if (missed()) return false;
    uint8_t mask = hal::FIRST_MASK;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint, mask = twice(mask)) {
        if ((on & mask) != 0 || start_when_due(joint, mask)) continue;
        const hal::InterruptLock lock;
        if (step_missed == 0) step_missed = STEP_MISSED_AT_START | hal::step_interrupts_on();
        hal::steps_off();
        return false;
    }
    return step_missed == 0;
}

uint32_t end_steps() {
    uint8_t on;
    uint16_t last;
    {
        const hal::InterruptLock lock;
        on = step_missed | hal::step_interrupts_on();
        last = hal::end_steps();
    }
    hal::wait_step_high();
    uint8_t levels = hal::step_levels();  // pulses that rose without their interrupt having come
    hal::steps_fall();
    for_each_joint([&](auto joint) {
        constexpr uint8_t PIN = hal::COMPARE_PINS & hal::FIRST_MASK << joint.NUMBER;
        if ((levels & PIN) != 0) hal::count_step(joint.NUMBER);
    });
    cut_all(on, 0, 0);
    return clock::extend(last) - hal::LATE_TICKS;
}

void drop_runs() {
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        take_back(joint);
        clear(joint);
    }
    step_missed = 0;
}

// Locked for up to 93 cycles, with four joints up to 224 (tests/firmware/test_firmware_locks.py), which a
// step that comes meanwhile can bear: joints that may stop dead step far slower than the least interval.
bool freeze(uint32_t& now_ticks) {
    uint8_t on;
    uint16_t counter;
    {
        const hal::InterruptLock lock;
        counter = hal::counter();
        on = hal::step_interrupts_on();
        if (missed() || !may_freeze(on, counter)) return false;
        hal::steps_off();
    }
    now_ticks = clock::extend(counter);
    cut_all(on, now_ticks, counter);
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) take_back(joint);
    return true;
}

Position position() {
    Position total;
    uint8_t on;
    total.counter = look(on);
    uint8_t mask = hal::FIRST_MASK;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint, mask = twice(mask)) {
        const StepJoint& at = joint_at(joint);
        int32_t& usteps = total.usteps[joint];
        usteps = at.position_usteps;
        const Run* run = at.oldest;
        for (; run != at.seen_active; run = run->next) add_steps(usteps, *run, run->steps);
        if ((on & mask) != 0) add_steps(usteps, *run, static_cast<uint8_t>(run->steps - at.seen_left));
    }
    return total;
}

void set_dir_inverted(uint8_t joint, bool inverted) { joint_at(joint).dir_inverted = inverted; }

void set_position(uint8_t joint, int32_t usteps) {
    take_back(joint);
    joint_at(joint).position_usteps = usteps;
}

}  // namespace step_engine
}  // namespace planarm
