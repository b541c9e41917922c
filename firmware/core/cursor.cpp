#include "cursor.h"

namespace planarm {

using path_clock::Slice;

namespace {

// The longest interval inside a run, and the longest wait between two runs that the step interrupt bridges:
// the 16-bit timer must tell early from late.
constexpr uint16_t MOST_AHEAD_TICKS = 32000;
static_assert(MOST_AHEAD_TICKS < wire::MIN_SLOW_INTERVAL_TICKS, "slow moves are made step by step");
constexpr uint32_t MOST_AHEAD_Q16 = static_cast<uint32_t>(MOST_AHEAD_TICKS) << 16;

// A joint that has not moved yet did so this long ago.
constexpr uint32_t LONG_AGO_TICKS = 0x80000000;

uint16_t whole_ticks(uint32_t ticks_q16) { return static_cast<uint16_t>(ticks_q16 >> 16); }

}  // namespace

void Cursor::reset() {
    left_.count = 0;
    last_path_ticks_ = 0 - LONG_AGO_TICKS;
}

void Cursor::begin(const Move& move) {
    at_ = {move.first_ticks, 0};
    left_ = move;
    guess_ = 0;
}

bool Cursor::has_step_in(const Slice& slice) const {
    return left_.count != 0 && at_.high < slice.path_ticks();
}

bool Cursor::is_calm(const Slice& slice, uint32_t start_stop_ticks) const {
    if (!has_step_in(slice)) return true;
    const uint32_t stretch = slice.least_stretch();
    // As a rule this tells.
    if (multiply_q16(at_.high - last_path_ticks_, stretch) < start_stop_ticks) return false;
    if (left_.count < 2) return true;
    const uint32_t change = multiply_low(left_.add, static_cast<uint16_t>(left_.count - 2));
    uint32_t interval = least_of(left_.interval, left_.interval + change) >> 8;
    if (left_.slow == 0) interval >>= 8;
    return multiply_q16(interval, stretch) >= start_stop_ticks;
}

void Cursor::step() {
    Fixed48 interval = from_q16(left_.interval);
    if (left_.slow != 0) interval = {left_.interval >> 8, static_cast<uint16_t>(left_.interval << 8)};
    add_to(at_, interval);
    increase(left_.interval, left_.add);
}

// n I + n (n - 1) / 2 A further. A product with an A below 0 is 2^32 times the factor too large.
void Cursor::skip(uint8_t steps) {
    const uint8_t before = static_cast<uint8_t>(steps - 1);
    const uint16_t pairs = static_cast<uint16_t>(static_cast<uint16_t>(steps) * before) >> 1;
    add_to(at_, multiply(left_.interval, steps));
    add_to(at_, multiply(left_.add, pairs));
    if (static_cast<int32_t>(left_.add) < 0)
        increase(at_.high, static_cast<uint32_t>(static_cast<uint16_t>(0 - pairs)) << 16);
    increase(left_.interval, multiply_low(left_.add, steps));
}

// As many as the slice before had, or as fit at the interval of now.
uint8_t Cursor::guess(uint16_t path_ticks) const {
    if (guess_ != 0) return guess_;
    const uint32_t whole = path_ticks / ((left_.interval >> 16) + 1);
    return whole < step_engine::MAX_RUN_STEPS ? static_cast<uint8_t>(whole + 1) : step_engine::MAX_RUN_STEPS;
}

// To the last step before the slice's end; the last slice of a segment takes all that are left. From a guess
// their number becomes right in some turns. None is left for a run of its own: a run keeps the least
// interval, two times of a stretched slice may come out a tick closer.
uint8_t Cursor::go_to_last(const Slice& slice, const Cursor& first) {
    const uint8_t most = left_.count < step_engine::MAX_RUN_STEPS ? static_cast<uint8_t>(left_.count)
                                                                  : step_engine::MAX_RUN_STEPS;
    uint8_t steps = most;
    if (!slice.ends_segment()) steps = guess(static_cast<uint16_t>(slice.path_ticks() - at_.high));
    if (steps > most) steps = most;
    skip(static_cast<uint8_t>(steps - 1));
    // Back by what is too far at the interval there (after a move's end it may be 0), the longest where
    // intervals grow.
    while (at_.high >= slice.path_ticks()) {
        const uint32_t less = (at_.high - slice.path_ticks()) / (left_.interval >> 16 | 1) + 1;
        steps = steps > less ? static_cast<uint8_t>(steps - less) : 1;
        *this = first;
        skip(static_cast<uint8_t>(steps - 1));
    }
    while (steps != most &&
           left_.interval <
               (static_cast<uint32_t>(static_cast<uint16_t>(slice.path_ticks() - at_.high)) << 16) -
                   at_.low) {
        step();
        ++steps;
    }
    return steps;
}

// Saturated beyond what the step interrupt bridges.
[[gnu::noinline]] uint16_t stretched(uint32_t stretch, uint32_t interval_q16) {
    const uint32_t ticks = multiply_high(stretch, whole_ticks(interval_q16));
    return ticks > MOST_AHEAD_TICKS ? 0xFFFF : static_cast<uint16_t>(ticks);
}

// Intervals that bring the run's steps to its last tick, exactly, and grow as those of the path do when they
// are stretched, or less where one of them would be shorter than the joint can step. What they grow by
// between the stretches at the first step and at the last goes to all of them: from the middle of the first
// to that of the last it is as much less as they are fewer. False when the step interrupt cannot bridge them.
bool Cursor::fit(const uint32_t* stretches, Run& run) const {
    const uint16_t first = stretched(stretches[0], run.interval_q16);
    const uint16_t last = stretched(stretches[1], left_.interval - left_.add);
    if (first > MOST_AHEAD_TICKS || last > MOST_AHEAD_TICKS) return false;
    const bool shrinks = last < first;
    uint16_t growth = static_cast<uint16_t>(shrinks ? first - last : last - first);

    const uint8_t intervals = static_cast<uint8_t>(run.steps - 1);
    run.fraction = 0;
    run.interval_q16 = hal::divide_q16(last_ticks_ - run.first_ticks, intervals);
    const uint16_t mean = whole_ticks(run.interval_q16);
    const uint16_t room =
        mean > wire::MIN_INTERVAL_TICKS ? static_cast<uint16_t>(mean - wire::MIN_INTERVAL_TICKS) : 0;
    // To the half tick: the least interval has nothing to give.
    if (growth > static_cast<uint16_t>(2 * room)) growth = static_cast<uint16_t>(2 * room);
    run.add_q16 = hal::divide_q16(growth, intervals);
    const uint32_t half_q16 = multiply_low(run.add_q16, static_cast<uint8_t>(intervals - 1)) >> 1;
    const uint32_t most_q16 = run.interval_q16 + half_q16;
    if (shrinks) {
        run.add_q16 = 0 - run.add_q16;
        run.interval_q16 = most_q16;
    } else {
        run.interval_q16 -= half_q16;
    }
    return most_q16 <= MOST_AHEAD_Q16;
}

bool Cursor::take(const Slice& slice, Run& run) {
    const Cursor first = *this;
    const uint16_t first_path = static_cast<uint16_t>(at_.high);
    run.positive = left_.positive;
    run.fraction = at_.low;
    run.interval_q16 = left_.interval;
    run.add_q16 = left_.add;
    uint32_t stretches[2] = {};
    if (!slice.is_plain()) stretches[0] = slice.stretch_at(first_path);
    run.first_ticks = slice.ticks_at(first_path, stretches[0]);
    // The step interrupt bridges none of a slow move's intervals.
    run.steps = left_.slow != 0 ? 1 : go_to_last(slice, first);
    const bool near = run.first_ticks - last_ticks_ <= MOST_AHEAD_TICKS;
    if (!slice.is_plain()) stretches[1] = slice.stretch_at(static_cast<uint16_t>(at_.high));
    last_ticks_ = slice.ticks_at(static_cast<uint16_t>(at_.high), stretches[1]);
    if (run.steps != 1) {
        const bool fits = slice.is_plain() ? run.interval_q16 <= MOST_AHEAD_Q16 &&
                                                 left_.interval - left_.add <= MOST_AHEAD_Q16
                                           : fit(stretches, run);
        if (!fits) {
            *this = first;
            last_ticks_ = run.first_ticks;
            run.steps = 1;
        }
    }
    // From slice to slice the number of steps changes little: where one run makes them all it is a good
    // guess. While the clock is stretched one less, as a step more takes less time than one back.
    const bool all =
        run.steps != step_engine::MAX_RUN_STEPS && first_path <= whole_ticks(first.left_.interval);
    guess_ = all ? static_cast<uint8_t>(run.steps - !slice.is_plain()) : 0;
    left_.count = static_cast<uint16_t>(left_.count - run.steps);
    last_path_ticks_ = at_.high;
    step();
    return near;
}

void Cursor::finish(const Slice& slice) {
    at_.high -= slice.path_ticks();
    last_path_ticks_ -= slice.path_ticks();
}

}  // namespace planarm
