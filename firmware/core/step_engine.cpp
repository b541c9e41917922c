#include "step_engine.h"

namespace planarm {

StepJoint step_joints[wire::JOINTS];
volatile bool step_missed;

namespace step_engine {

namespace {

// One run more than can be in use, so that a full ring and an empty one differ.
constexpr uint8_t RING_RUNS = 4;
// How far ahead of its first step a joint is started.
constexpr int32_t START_AHEAD_TICKS = 0x8000;

struct Ring {
    Run runs[RING_RUNS];
    Run* oldest;              // not yet taken back
    Run* free;                // the next to be filled
    int32_t position_usteps;  // of all runs taken back
    bool positive;            // direction of the run appended last
};

Ring rings[wire::JOINTS];

int32_t signed_steps(const Run& run, uint16_t steps) {
    return run.positive ? static_cast<int32_t>(steps) : -static_cast<int32_t>(steps);
}

void clear(uint8_t joint) {
    Ring& ring = rings[joint];
    for (uint8_t i = 0; i < RING_RUNS; ++i) {
        ring.runs[i].chained = Chain::NONE;
        ring.runs[i].next = &ring.runs[(i + 1) % RING_RUNS];
    }
    ring.oldest = ring.free = ring.runs;
    step_joints[joint].active = ring.runs;
}

Run* active_run(uint8_t joint) {
    const hal::InterruptLock lock;
    return step_joints[joint].active;
}

void take_back(uint8_t joint) {
    Ring& ring = rings[joint];
    const Run* const active = active_run(joint);
    while (ring.oldest != active) {
        ring.oldest->chained = Chain::NONE;
        ring.position_usteps += signed_steps(*ring.oldest, ring.oldest->steps);
        ring.oldest = ring.oldest->next;
    }
}

// Places the first edge of an idle joint's next run. False when it is too late for it.
template <uint8_t JOINT>
bool start(const Run& run) {
    const uint16_t margin = hal::dir_is<JOINT>(run.positive) ? STEP_MARGIN_TICKS : DIR_MARGIN_TICKS;
    hal::dir_write<JOINT>(run.positive);
    const uint16_t edge = static_cast<uint16_t>(run.first_ticks);
    const hal::InterruptLock lock;
    hal::step_set_edge<JOINT>(edge);
    hal::step_forget_match<JOINT>();
    const uint16_t remaining = static_cast<uint16_t>(edge - hal::counter());
    if (static_cast<uint16_t>(remaining - margin) > START_AHEAD_TICKS) return false;
    hal::step_arm<JOINT>();
    hal::step_interrupt_on<JOINT>();
    return true;
}

template <uint8_t JOINT>
bool start_when_due(uint32_t now_ticks) {
    if (hal::step_interrupt_is_on<JOINT>()) return true;
    const Run* const run = step_joints[JOINT].active;  // the interrupt is off: nobody else writes it
    if (run == rings[JOINT].free) return true;
    const int32_t away_ticks = static_cast<int32_t>(run->first_ticks - now_ticks);
    if (away_ticks > START_AHEAD_TICKS) return true;
    return away_ticks > 0 && start<JOINT>(*run);
}

// A pulse that rose without its interrupt having come: counts it and lets it fall. Interrupts are off,
// nothing is armed.
template <uint8_t JOINT>
void finish_pulse() {
    if (!hal::step_is_high<JOINT>()) return;
    Run* const run = step_joints[JOINT].active;
    if (--run->steps_left == 0) step_joints[JOINT].active = run->next;
    hal::step_fall<JOINT>();
}

// What the interrupts change, copied at one instant.
struct Progress {
    uint16_t counter;
    const Run* active[wire::JOINTS];
    uint16_t left[wire::JOINTS];
    bool high[wire::JOINTS];
};

Progress progress() {
    Progress copy;
    const hal::InterruptLock lock;
    copy.counter = hal::counter();
    copy.high[0] = hal::step_is_high<0>();
    copy.high[1] = hal::step_is_high<1>();
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        copy.active[joint] = step_joints[joint].active;
        copy.left[joint] = copy.active[joint]->steps_left;
    }
    return copy;
}

}  // namespace

void reset() {
    step_missed = false;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        clear(joint);
        rings[joint].position_usteps = 0;
    }
}

bool has_room(uint8_t joint) { return rings[joint].free->next != rings[joint].oldest; }

void append(uint8_t joint, const Move& move, uint32_t start_ticks) {
    Ring& ring = rings[joint];
    Run& run = *ring.free;
    run.interval_q16 = move.interval_q16;
    run.add_q16 = static_cast<uint32_t>(move.add_q16);
    run.fraction = 0;
    run.steps_left = run.steps = move.steps;
    run.first_ticks = start_ticks + move.first_ticks;
    run.positive = move.positive;
    const Chain near = move.positive == ring.positive ? Chain::ONWARD : Chain::REVERSED;
    ring.positive = move.positive;
    hal::compiler_barrier();
    run.chained = move.near ? near : Chain::NONE;
    ring.free = run.next;
}

bool serve(uint32_t now_ticks) {
    if (!start_when_due<0>(now_ticks) || !start_when_due<1>(now_ticks)) step_missed = true;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) take_back(joint);
    return !step_missed;
}

void stop() {
    {
        const hal::InterruptLock lock;
        hal::steps_off();
        hal::wait_step_high();
        finish_pulse<0>();
        finish_pulse<1>();
    }
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        take_back(joint);
        Ring& ring = rings[joint];
        const Run* const active = step_joints[joint].active;
        if (active != ring.free) {
            ring.position_usteps +=
                signed_steps(*active, static_cast<uint16_t>(active->steps - active->steps_left));
        }
        clear(joint);
    }
    step_missed = false;
}

Position position() {
    const Progress now = progress();
    Position total;
    total.counter = now.counter;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        const Ring& ring = rings[joint];
        int32_t usteps = ring.position_usteps;
        for (const Run* run = ring.oldest; run != now.active[joint]; run = run->next) {
            usteps += signed_steps(*run, run->steps);
        }
        if (now.active[joint] != ring.free) {
            const Run& run = *now.active[joint];
            usteps += signed_steps(
                run, static_cast<uint16_t>(run.steps - now.left[joint] + (now.high[joint] ? 1 : 0)));
        }
        total.usteps[joint] = usteps;
    }
    return total;
}

}  // namespace step_engine
}  // namespace planarm
