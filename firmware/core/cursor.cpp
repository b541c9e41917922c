#include "cursor.h"

namespace planarm {

using path_clock::Slice;

namespace {

// The longest interval inside a run, and the longest wait between two runs that the step interrupt bridges:
// the 16-bit timer must tell early from late.
constexpr uint16_t MOST_AHEAD_TICKS = 32000;
constexpr uint32_t MOST_AHEAD_Q16 = static_cast<uint32_t>(MOST_AHEAD_TICKS) << 16;

// A joint that has not moved yet did so this long ago.
constexpr uint32_t LONG_AGO_TICKS = 0x80000000;

uint16_t whole_ticks(uint32_t ticks_q16) { return static_cast<uint16_t>(ticks_q16 >> 16); }

}  // namespace

void Cursor::reset() {
    left_ = 0;
    last_path_ticks_ = 0 - LONG_AGO_TICKS;
}

void Cursor::begin(const Move& move) {
    at_ = {move.first_ticks, 0};
    interval_q16_ = move.interval_q16;
    add_q16_ = static_cast<uint32_t>(move.add_q16);
    left_ = move.steps;
    guess_ = 0;
    positive_ = move.positive;
}

bool Cursor::is_calm(const Slice& slice, uint32_t start_stop_ticks) const {
    if (!has_step_in(slice)) return true;
    uint32_t least_ticks = at_.high - last_path_ticks_;
    if (left_ > 1) {
        const uint16_t first = whole_ticks(interval_q16_);
        const uint16_t last =
            whole_ticks(interval_q16_ + multiply_low(add_q16_, static_cast<uint16_t>(left_ - 2)));
        if (first < least_ticks) least_ticks = first;
        if (last < least_ticks) least_ticks = last;
    }
    return multiply_q16(least_ticks, slice.least_stretch()) >= start_stop_ticks;
}

void Cursor::find_last(Steps& steps) const {
    const uint8_t before = static_cast<uint8_t>(steps.count - 1);
    const uint16_t pairs = static_cast<uint16_t>(before * (before - 1u)) >> 1;
    steps.last_q16 = at_.low + multiply_low(interval_q16_, before) + multiply_low(add_q16_, pairs);
    steps.interval_q16 = interval_q16_ + multiply_low(add_q16_, before);
}

// As many as the slice before had, or as fit at the interval of now.
uint8_t Cursor::guess(uint16_t path_ticks) const {
    if (guess_ != 0) return guess_;
    const uint16_t whole = static_cast<uint16_t>(path_ticks / (whole_ticks(interval_q16_) + 1u));
    return whole < step_engine::MAX_RUN_STEPS ? static_cast<uint8_t>(whole + 1) : step_engine::MAX_RUN_STEPS;
}

// Those before the slice's end; the last slice of a segment takes all that are left. From a guess their
// number becomes right step by step.
void Cursor::find_steps(const Slice& slice, Steps& steps) const {
    const uint8_t most =
        left_ < step_engine::MAX_RUN_STEPS ? static_cast<uint8_t>(left_) : step_engine::MAX_RUN_STEPS;
    const uint16_t path_ticks = static_cast<uint16_t>(slice.path_ticks() - at_.high);
    steps.count = slice.ends_segment() ? most : guess(path_ticks);
    if (steps.count > most) steps.count = most;
    find_last(steps);
    if (slice.ends_segment()) return;

    // Where intervals grow a guess may be longer than 2^32 can tell.
    while (multiply(steps.interval_q16 - add_q16_, steps.count).high > 0xFFFF) {
        steps.count = static_cast<uint8_t>(steps.count - (steps.count + 3u) / 4);
        find_last(steps);
    }
    while (whole_ticks(steps.last_q16) >= path_ticks) {
        steps.interval_q16 -= add_q16_;
        steps.last_q16 -= steps.interval_q16;
        --steps.count;
    }
    while (steps.count != most) {
        const uint32_t next_q16 = steps.last_q16 + steps.interval_q16;
        if (next_q16 < steps.last_q16 || whole_ticks(next_q16) >= path_ticks) return;
        steps.last_q16 = next_q16;
        steps.interval_q16 += add_q16_;
        ++steps.count;
    }
}

// Intervals that bring the run's steps to its last tick, exactly, and grow as those of the path do when they
// are stretched, or less where one of them would be shorter than the joint can step. False when the step
// interrupt cannot bridge them.
bool Cursor::fit(const Slice& slice, const Steps& steps, uint16_t first_path, Run& run) const {
    uint16_t first = whole_ticks(interval_q16_);
    uint16_t last = whole_ticks(steps.interval_q16 - add_q16_);
    const uint16_t last_path = static_cast<uint16_t>(first_path + whole_ticks(steps.last_q16));
    // The stretch is that in the middle of an interval.
    first = slice.stretched(first, static_cast<uint16_t>(first_path + first / 2));
    last = slice.stretched(last, static_cast<uint16_t>(last_path - last / 2));
    if (first > MOST_AHEAD_TICKS || last > MOST_AHEAD_TICKS) return false;

    const uint8_t intervals = static_cast<uint8_t>(steps.count - 1);
    const uint32_t mean_q16 = hal::divide_q16(last_ticks_ - run.first_ticks, intervals);
    run.fraction = 0;
    run.interval_q16 = mean_q16;
    run.add_q16 = 0;
    const uint8_t changes = static_cast<uint8_t>(intervals - 1);
    if (changes == 0) return mean_q16 <= MOST_AHEAD_Q16;
    const bool shrinks = last < first;
    uint16_t growth = static_cast<uint16_t>(shrinks ? first - last : last - first);
    const uint16_t mean = whole_ticks(mean_q16);
    const uint16_t room =
        mean > wire::MIN_INTERVAL_TICKS ? static_cast<uint16_t>(mean - wire::MIN_INTERVAL_TICKS) : 0;
    if (growth / 2 > room) growth = static_cast<uint16_t>(2 * room);
    const uint32_t add_q16 = hal::divide_q16(growth, changes);
    const uint32_t half_q16 = multiply_low(add_q16, changes) >> 1;
    run.add_q16 = shrinks ? 0 - add_q16 : add_q16;
    run.interval_q16 = shrinks ? mean_q16 + half_q16 : mean_q16 - half_q16;
    return mean_q16 + half_q16 <= MOST_AHEAD_Q16;
}

bool Cursor::take(const Slice& slice, Run& run) {
    Steps steps;
    find_steps(slice, steps);
    const uint16_t first_path = static_cast<uint16_t>(at_.high);
    run.positive = positive_;
    run.fraction = at_.low;
    run.interval_q16 = interval_q16_;
    run.add_q16 = add_q16_;
    run.first_ticks = slice.ticks_at(first_path);
    const bool near = run.first_ticks - last_ticks_ <= MOST_AHEAD_TICKS;
    last_ticks_ = slice.ticks_at(static_cast<uint16_t>(first_path + whole_ticks(steps.last_q16)));
    if (steps.count != 1) {
        const bool fits = slice.is_plain() ? interval_q16_ <= MOST_AHEAD_Q16 &&
                                                 steps.interval_q16 - add_q16_ <= MOST_AHEAD_Q16
                                           : fit(slice, steps, first_path, run);
        if (!fits) {
            last_ticks_ = run.first_ticks;
            steps.count = 1;
            find_last(steps);
        }
    }
    run.steps = steps.count;
    // From slice to slice the number of steps changes little: where one run makes them all it is a good
    // guess.
    const bool all = steps.count != step_engine::MAX_RUN_STEPS && first_path <= whole_ticks(interval_q16_);
    guess_ = all ? steps.count : 0;
    advance(steps);
    return near;
}

void Cursor::advance(const Steps& steps) {
    left_ = static_cast<uint16_t>(left_ - steps.count);
    at_.low = 0;  // that of the first step is in the last one's time
    add_to(at_, from_q16(steps.last_q16));
    last_path_ticks_ = at_.high;
    add_to(at_, from_q16(steps.interval_q16));
    interval_q16_ = steps.interval_q16 + add_q16_;
}

void Cursor::finish(const Slice& slice) {
    at_.high -= slice.path_ticks();
    last_path_ticks_ -= slice.path_ticks();
}

}  // namespace planarm
