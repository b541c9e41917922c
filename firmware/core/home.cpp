#include "home.h"

#include "clock.h"
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

wire::Home order;
Phase phase = Phase::NONE;
uint32_t steps_left;
uint32_t next_ticks;  // of the next step
bool first_step;

void enter(Phase next, uint32_t steps, uint32_t start_ticks) {
    phase = next;
    steps_left = steps;
    next_ticks = start_ticks;
    first_step = true;
}

uint32_t interval_ticks() { return phase == Phase::APPROACH ? order.fast_ticks : order.slow_ticks; }

// False when all steps of the phase were made.
bool feed() {
    const int32_t ahead_ticks = clock::ticks_until(next_ticks);
    if (ahead_ticks > AHEAD_TICKS) return true;
    if (steps_left == 0) return ahead_ticks > 0;
    if (!step_engine::has_room(order.joint)) return true;
    const uint32_t interval = interval_ticks();
    step_engine::Piece piece;
    piece.first_ticks = next_ticks;
    piece.interval_q16 = piece.add_q16 = 0;
    piece.fraction = 0;
    piece.steps = 1;
    piece.positive = (order.positive == 1) != (phase == Phase::BACK);
    piece.near = !first_step && interval <= NEAR_TICKS;
    step_engine::append(order.joint, piece);
    first_step = false;
    next_ticks += interval;
    --steps_left;
    return true;
}

}  // namespace

void reset() { phase = Phase::NONE; }

bool is_good(const wire::Home& told) {
    const bool slow_enough = told.fast_ticks >= MIN_REVERSAL_TICKS && told.slow_ticks >= told.fast_ticks &&
                             told.slow_ticks >= 2 * wire::DEBOUNCE_TICKS;
    const bool short_enough = told.slow_ticks <= wire::MAX_SEGMENT_TICKS;
    return told.joint < wire::JOINTS && told.positive <= 1 && slow_enough && short_enough &&
           told.back_usteps != 0;
}

void begin(const wire::Home& told, uint32_t start_ticks) {
    order = told;
    if (inputs::is_hit(order.joint)) {
        enter(Phase::BACK, order.back_usteps, start_ticks);
    } else {
        enter(Phase::APPROACH, order.most_usteps, start_ticks);
    }
}

void cancel() { phase = Phase::NONE; }

bool is_active() { return phase != Phase::NONE; }

uint8_t joint() { return order.joint; }

Progress serve() {
    if (phase == Phase::NONE) return Progress::NONE;
    if (!step_engine::serve()) return Progress::MISSED;
    const bool hit = inputs::is_hit(order.joint);
    const bool there = phase == Phase::BACK ? !hit : hit;
    if (!there) return feed() ? Progress::GOING : Progress::FAILED;
    step_engine::stop();
    switch (phase) {
        case Phase::APPROACH:
            enter(Phase::BACK, order.back_usteps, clock::pass_ticks() + PAUSE_TICKS);
            return Progress::GOING;
        case Phase::BACK:
            enter(Phase::TOUCH, order.back_usteps, clock::pass_ticks() + PAUSE_TICKS);
            return Progress::GOING;
        default:
            phase = Phase::NONE;
            return Progress::DONE;
    }
}

}  // namespace home
}  // namespace planarm
