#include "home.h"

#include "clock.h"
#include "fixed.h"
#include "hal_base.h"
#include "inputs.h"
#include "segment.h"
#include "step_engine.h"

namespace planarm {
namespace home {

namespace {

enum class Phase : uint8_t { NONE, APPROACH, BACK, TOUCH };

// Steps are handed over one by one, this long ahead, so that little is left to be dropped at the switch.
constexpr int32_t AHEAD_TICKS = 30000;
constexpr uint32_t NEAR_TICKS = 32000;
// Between two phases the joint stands still.
constexpr uint32_t PAUSE_TICKS = 1600000;

struct Homing {
    wire::Home
        order;  // fast_ticks and most_usteps are the phase's: its interval, and its steps that are left
    Phase phase;
    uint32_t next_ticks;  // of the next step
};

Homing homing;

[[gnu::noinline]] void enter(Homing& at, Phase phase, uint32_t start_ticks) {
    at.phase = phase;
    at.next_ticks = start_ticks;
    if (phase == Phase::APPROACH) return;
    at.order.fast_ticks = at.order.slow_ticks;
    at.order.most_usteps = at.order.back_usteps;
}

// False when all steps of the phase were made. A run of one step needs no interval.
bool feed(Homing& at) {
    const int32_t ahead_ticks = clock::ticks_until(at.next_ticks);
    if (ahead_ticks > AHEAD_TICKS) return true;
    if (at.order.most_usteps == 0) return ahead_ticks > 0;
    if (!step_engine::has_room(at.order.joint)) return true;
    Run& run = step_engine::next_run(at.order.joint);
    run.first_ticks = at.next_ticks;
    run.steps = 1;
    run.positive = (at.order.positive == 1) != (at.phase == Phase::BACK);
    step_engine::append(at.order.joint, at.order.fast_ticks <= NEAR_TICKS);
    increase(at.next_ticks, at.order.fast_ticks);
    --at.order.most_usteps;
    return true;
}

}  // namespace

void reset() { hal::clear_at_start(homing); }

bool is_good(const wire::Home& told) {
    static_assert(wire::MIN_HOMING_TICKS >= MIN_REVERSAL_TICKS, "the way back");
    const bool slow_enough = told.fast_ticks >= wire::MIN_HOMING_TICKS &&
                             told.slow_ticks >= told.fast_ticks &&
                             told.slow_ticks >= 2 * wire::DEBOUNCE_TICKS;
    const bool short_enough = told.slow_ticks <= wire::MAX_SEGMENT_TICKS;
    return told.joint < wire::JOINTS && told.positive <= 1 && slow_enough && short_enough &&
           told.back_usteps != 0;
}

void begin(const wire::Home& told, uint32_t start_ticks) {
    Homing& at = hal::by_base(homing);
    at.order = told;
    enter(at, inputs::is_hit(told.joint) ? Phase::BACK : Phase::APPROACH, start_ticks);
}

void cancel() { homing.phase = Phase::NONE; }

bool is_active() { return homing.phase != Phase::NONE; }

uint8_t joint() { return homing.order.joint; }

Progress serve() {
    Homing& at = hal::by_base(homing);
    if (at.phase == Phase::NONE) return Progress::NONE;
    if (!step_engine::serve()) return Progress::MISSED;
    const bool hit = inputs::is_hit(at.order.joint);
    const bool there = at.phase == Phase::BACK ? !hit : hit;
    if (!there) return feed(at) ? Progress::GOING : Progress::FAILED;
    step_engine::end_steps();
    step_engine::drop_runs();
    if (at.phase == Phase::TOUCH) {
        at.phase = Phase::NONE;
        return Progress::DONE;
    }
    enter(at, at.phase == Phase::APPROACH ? Phase::BACK : Phase::TOUCH, clock::pass_ticks() + PAUSE_TICKS);
    return Progress::GOING;
}

}  // namespace home
}  // namespace planarm
