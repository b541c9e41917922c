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

// One run more than can be in use, so that a full ring and an empty one differ. Four joints have two: the
// bytes of a third are the queue's, and the pace that the certificate asks for is kept
// (tests/firmware/test_firmware_pace.py).
constexpr uint8_t RING_RUNS = 4;
// How far ahead of its first step a joint is started: the 16-bit timer must still tell early from late.
constexpr int32_t START_AHEAD_TICKS = 0x7000;
// A freeze leaves alone a step that is nearer than this.
constexpr uint16_t FREEZE_MARGIN_TICKS = 200;

struct Ring {
    Run* oldest;              // not yet taken back
    Run* free;                // the next to be filled
    int32_t position_usteps;  // of all runs taken back
    bool positive;            // direction of the run appended last
    bool dir_inverted;
    Run runs[RING_RUNS];  // last: see FrameReceiver
};

Ring rings[wire::JOINTS];

// A call takes less code than the product.
[[gnu::noinline]] Ring& ring_of(uint8_t joint) { return rings[joint]; }

// Moves a position on by steps of a run, modulo 2^32: SET_POSITION takes any.
[[gnu::noinline]] void add_steps(int32_t& position_usteps, const Run& run, uint8_t steps) {
    const uint32_t before = static_cast<uint32_t>(position_usteps);
    position_usteps = static_cast<int32_t>(run.positive ? before + steps : before - steps);
}

void clear(uint8_t joint) {
    Ring& ring = ring_of(joint);
    for (uint8_t i = 0; i < RING_RUNS; ++i) {
        ring.runs[i].chained = Chain::NONE;
        ring.runs[i].next = &ring.runs[(i + 1) % RING_RUNS];
    }
    ring.oldest = ring.free = ring.runs;
    step_joints[joint].active = ring.runs;
}

// Without a lock, as it is asked for between the steps of all joints: what is read twice was not written in
// between.
Run* active_run(uint8_t joint) {
    const StepJoint& read = step_joints[joint];
    Run* seen;
    do {
        seen = read.active;
    } while (seen != read.active);
    return seen;
}

void take_back(uint8_t joint) {
    Ring& ring = ring_of(joint);
    const Run* const active = active_run(joint);
    while (ring.oldest != active) {
        ring.oldest->chained = Chain::NONE;
        add_steps(ring.position_usteps, *ring.oldest, ring.oldest->steps);
        ring.oldest = ring.oldest->next;
    }
}

// Places the first edge of an idle joint's next run. False when it is too late for it.
template <uint8_t JOINT>
bool start(const Run& run) {
    const uint16_t margin = static_cast<uint16_t>(
        (hal::dir_is<JOINT>(run.dir_high) ? hal::START_MARGIN_TICKS : DIR_MARGIN_TICKS) +
        hal::step_early_ticks<JOINT>());
    hal::dir_write<JOINT>(run.dir_high);
    hal::set_steps_left<JOINT>(run.steps);
    hal::set_step_fraction<JOINT>(run.fraction);
    const uint16_t edge = static_cast<uint16_t>(run.first_ticks);
    const hal::InterruptLock lock;
    hal::step_set_edge<JOINT>(edge);
    hal::step_forget_match<JOINT>();
    const uint16_t nearest = static_cast<uint16_t>(hal::counter() + margin);
    if (static_cast<int16_t>(edge - nearest) < 0) return false;
    // Its interrupt may be off because a step has just been missed, or by an emergency.
    if (missed() || hal::emergency() != hal::Emergency::NONE) return true;
    hal::step_arm<JOINT>();
    hal::step_interrupt_on<JOINT>();
    return true;
}

enum class Due : uint8_t { NO, YES, TOO_LATE };

// Whether an idle joint's next run must be started now. Its interrupt is off: nobody else writes `active`.
Due is_due(uint8_t joint) {
    const Run* const run = step_joints[joint].active;
    if (run == ring_of(joint).free) return Due::NO;
    const int32_t away_ticks = clock::ticks_until(run->first_ticks);
    if (away_ticks > START_AHEAD_TICKS) return Due::NO;
    return away_ticks > 0 ? Due::YES : Due::TOO_LATE;
}

template <uint8_t JOINT>
bool start_when_due() {
    if (hal::step_interrupt_is_on<JOINT>()) return true;
    const Due due = is_due(JOINT);
    return due == Due::NO || (due == Due::YES && start<JOINT>(*step_joints[JOINT].active));
}

// A pulse that rose without its interrupt having come: counts it and lets it fall. Interrupts are off,
// nothing is armed.
template <uint8_t JOINT>
void finish_pulse() {
    if (!hal::step_is_high<JOINT>()) return;
    if (!hal::step_is_counted<JOINT>())
        hal::set_steps_left<JOINT>(static_cast<uint8_t>(hal::steps_left<JOINT>() - 1));
    hal::step_fall<JOINT>();
}

// Cuts the executed part off the active run of a joint that had its interrupt on, which is off by now: that
// goes to the position, the rest keeps its distance to the moment, told by both clocks.
[[gnu::noinline]] void cut_active(uint8_t joint, uint8_t were_on, uint32_t now_ticks, uint16_t counter) {
    uint8_t mask = 0, left = 0;
    uint16_t fraction = 0, edge = 0;
    for_each_joint([&](auto number) {
        constexpr uint8_t NUMBER = number.NUMBER;
        if (joint != NUMBER) return;
        mask = hal::step_interrupt_mask<NUMBER>();
        left = hal::steps_left<NUMBER>();
        fraction = hal::step_fraction<NUMBER>();
        edge = hal::step_edge<NUMBER>();
    });
    if ((were_on & mask) == 0) return;
    Run& run = *step_joints[joint].active;
    add_steps(ring_of(joint).position_usteps, run, static_cast<uint8_t>(run.steps - left));
    run.steps = left;
    run.fraction = fraction;
    run.first_ticks = now_ticks + static_cast<uint16_t>(edge - counter);
    if (left == 0) step_joints[joint].active = run.next;
}

[[gnu::noinline]] void cut_all(uint8_t were_on, uint32_t now_ticks, uint16_t counter) {
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) cut_active(joint, were_on, now_ticks, counter);
}

template <uint8_t JOINT>
bool may_freeze(uint16_t counter) {
    if (!hal::step_interrupt_is_on<JOINT>()) return true;
    // An edge that is past, and whose interrupt is only on its way, is no more than some hundred ticks away.
    const int16_t ahead = static_cast<int16_t>(hal::step_edge<JOINT>() - counter);
    return !hal::step_is_high<JOINT>() && ahead > static_cast<int16_t>(FREEZE_MARGIN_TICKS);
}

// What the interrupts change, as it was when the counter was read.
struct Progress {
    uint16_t counter;
    const Run* active[wire::JOINTS];
    uint8_t left[wire::JOINTS];
    uint8_t levels;
    uint8_t on;
};

bool has_active(const Progress& at) {
    bool same = true;
    for_each_joint(
        [&](auto joint) { same = same && step_joints[joint.NUMBER].active == at.active[joint.NUMBER]; });
    return same;
}

// A step that comes in a lock waits for its end, so what is locked here is what changes at every step, in few
// instructions: 11 cycles on the Uno, with the one behind it. The active runs change with the last step of a
// run only: when they are the same before and after, they were so in between.
Progress progress() {
    Progress at;
    do {
        // Read in this order: a step that is missed in between switches off what is then told by step_missed.
        at.on = hal::step_interrupts_on();
        at.on = static_cast<uint8_t>(at.on | step_missed);
        for_each_joint([&](auto joint) { at.active[joint.NUMBER] = step_joints[joint.NUMBER].active; });
        const hal::InterruptLock lock;
        for_each_joint([&](auto joint) { at.left[joint.NUMBER] = hal::steps_left<joint.NUMBER>(); });
        at.counter = hal::counter();
        at.levels = hal::step_levels();
    } while (!has_active(at));
    return at;
}

}  // namespace

void reset() {
    step_missed = 0;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        clear(joint);
        ring_of(joint).position_usteps = 0;
        ring_of(joint).dir_inverted = false;
    }
}

// Executed runs are taken back only when their room is needed.
bool has_room(uint8_t joint) {
    const Ring& ring = ring_of(joint);
    if (ring.free->next != ring.oldest) return true;
    take_back(joint);
    return ring.free->next != ring.oldest;
}

bool is_idle() {
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        if (active_run(joint) != ring_of(joint).free) return false;
    }
    return true;
}

Run& next_run(uint8_t joint) { return *ring_of(joint).free; }

void append(uint8_t joint, bool near) {
    Ring& ring = ring_of(joint);
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
    if (missed()) return false;
    bool in_time = true;
    for_each_joint([&](auto joint) { in_time = in_time && start_when_due<joint.NUMBER>(); });
    if (!in_time) {
        const hal::InterruptLock lock;
        if (step_missed == 0) step_missed = STEP_MISSED_AT_START | hal::step_interrupts_on();
        hal::steps_off();
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
    for_each_joint([&](auto joint) { finish_pulse<joint.NUMBER>(); });
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

// Locked for up to 80 cycles, which a step that comes meanwhile can bear: joints that may stop dead step far
// slower than the least interval.
bool freeze(uint32_t& now_ticks) {
    uint8_t on;
    uint16_t counter;
    {
        const hal::InterruptLock lock;
        counter = hal::counter();
        bool may = !missed();
        for_each_joint([&](auto joint) { may = may && may_freeze<joint.NUMBER>(counter); });
        if (!may) return false;
        on = hal::step_interrupts_on();
        hal::steps_off();
    }
    now_ticks = clock::extend(counter);
    cut_all(on, now_ticks, counter);
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) take_back(joint);
    return true;
}

Position position() {
    const Progress now = progress();
    Position total;
    total.counter = now.counter;
    uint8_t risen[wire::JOINTS];  // of the active run
    for_each_joint([&](auto joint) {
        constexpr uint8_t NUMBER = joint.NUMBER;
        const uint8_t steps = now.active[NUMBER]->steps;
        const uint8_t high = hal::step_level<NUMBER>(now.levels) ? 1 : 0;
        const bool is_on = (now.on & hal::step_interrupt_mask<NUMBER>()) != 0;
        risen[NUMBER] = is_on ? static_cast<uint8_t>(steps - now.left[NUMBER] + high) : 0;
    });
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        const Ring& ring = ring_of(joint);
        int32_t& usteps = total.usteps[joint];
        usteps = ring.position_usteps;
        for (const Run* run = ring.oldest; run != now.active[joint]; run = run->next) {
            add_steps(usteps, *run, run->steps);
        }
        add_steps(usteps, *now.active[joint], risen[joint]);
    }
    return total;
}

void set_dir_inverted(uint8_t joint, bool inverted) { ring_of(joint).dir_inverted = inverted; }

void set_position(uint8_t joint, int32_t usteps) {
    take_back(joint);
    ring_of(joint).position_usteps = usteps;
}

}  // namespace step_engine
}  // namespace planarm
