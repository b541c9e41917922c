#include "cursor.h"

namespace planarm {

using path_clock::Slice;

namespace {

// The longest interval inside a run, and the longest wait between two runs that the step interrupt bridges:
// the 16-bit timer must tell early from late.
constexpr uint32_t MOST_AHEAD_TICKS = 32000;
constexpr uint32_t MOST_AHEAD_Q16 = MOST_AHEAD_TICKS << 16;
constexpr uint32_t LEAST_Q16 = static_cast<uint32_t>(wire::MIN_INTERVAL_TICKS) << 16;

// Intervals of a run, in 2^-16 ticks.
struct Intervals {
    uint32_t first;
    uint32_t last;
};

bool are_near(const Intervals& run) { return run.first <= MOST_AHEAD_Q16 && run.last <= MOST_AHEAD_Q16; }

// The interval whose middle lies half of it after, or before, a path time.
Intervals stretched(const Slice& slice, const Intervals& path, uint16_t first_path, uint16_t last_path) {
    const uint16_t first_middle = static_cast<uint16_t>(first_path + (path.first >> 17));
    const uint16_t last_middle = static_cast<uint16_t>(last_path - (path.last >> 17));
    return {multiply_q16(path.first, slice.stretch_at(first_middle)),
            multiply_q16(path.last, slice.stretch_at(last_middle))};
}

// Intervals that bring the run's steps over `span_ticks`, exactly, and grow as `wanted` does, or less where
// one of them would be shorter than the joint can step. False when the step interrupt cannot bridge them.
bool fit(Run& run, uint32_t span_ticks, const Intervals& wanted) {
    const uint8_t intervals = static_cast<uint8_t>(run.steps - 1);
    const uint32_t mean_q16 = hal::divide_q16(span_ticks, intervals);
    run.interval_q16 = mean_q16;
    run.add_q16 = 0;
    if (intervals == 1) return mean_q16 <= MOST_AHEAD_Q16;
    const bool shrinks = wanted.last < wanted.first;
    uint32_t growth = shrinks ? wanted.first - wanted.last : wanted.last - wanted.first;
    const uint32_t room = mean_q16 > LEAST_Q16 ? mean_q16 - LEAST_Q16 : 0;
    if (growth >> 1 > room) growth = room << 1;
    const uint8_t changes = static_cast<uint8_t>(intervals - 1);
    const uint32_t add = hal::divide_q16(growth >> 16, changes);  // whole ticks of the growth are enough
    const uint32_t half = multiply(add, changes).low / 2 + (multiply(add, changes).high << 15);
    run.add_q16 = shrinks ? 0 - add : add;
    run.interval_q16 = shrinks ? mean_q16 + half : mean_q16 - half;
    return mean_q16 + half <= MOST_AHEAD_Q16;
}

}  // namespace

void Cursor::reset() {
    left_ = 0;
    has_moved_ = false;
}

void Cursor::begin(const Move& move) {
    at_ = {move.first_ticks, 0};
    interval_q16_ = move.interval_q16;
    add_q16_ = move.add_q16;
    left_ = move.steps;
    guess_ = 0;
    positive_ = move.positive;
}

bool Cursor::is_calm(const Slice& slice, uint32_t start_stop_ticks) const {
    if (!has_step_before(slice.end_path())) return true;
    uint32_t least = has_moved_ ? at_.high - last_path_ticks_ : 0xFFFFFFFF;
    if (slice.is_plain() && least < start_stop_ticks) return false;  // as a rule
    if (left_ > 1) {
        const uint32_t change =
            multiply(add_q16_ < 0 ? 0 - static_cast<uint32_t>(add_q16_) : static_cast<uint32_t>(add_q16_),
                     static_cast<uint16_t>(left_ - 2))
                .high;
        const uint32_t first = interval_q16_ >> 16;
        const uint32_t last = add_q16_ < 0 ? first - change - 1 : first;
        if (last < least) least = last;
    }
    return multiply_q16(least, slice.least_stretch()) >= start_stop_ticks;
}

bool Cursor::find_last(Steps& steps) const {
    const uint8_t before = static_cast<uint8_t>(steps.count - 1);
    const Fixed48 time = run_time(before, interval_q16_, add_q16_);
    if (time.high > 0xFFFF) return false;
    const uint32_t time_q16 = (time.high << 16) | time.low;
    steps.last_q16 = time_q16 + at_.low;
    steps.interval_q16 = interval_q16_;
    if (add_q16_ != 0) steps.interval_q16 += static_cast<uint32_t>(add_q16_) * before;
    return steps.last_q16 >= time_q16;
}

// Those before a border so far away; the last slice of a segment takes all that are left. From a guess their
// number becomes right step by step.
Cursor::Steps Cursor::steps_before(uint16_t path_ticks, bool ends_segment) const {
    const uint8_t most =
        left_ < step_engine::MAX_RUN_STEPS ? static_cast<uint8_t>(left_) : step_engine::MAX_RUN_STEPS;
    Steps steps;
    steps.count = guess_;
    if (guess_ == 0) {
        const uint16_t whole = static_cast<uint16_t>(interval_q16_ >> 16);
        const uint16_t many = path_ticks <= whole ? 0 : static_cast<uint16_t>(path_ticks / (whole + 1u));
        steps.count = many < most ? static_cast<uint8_t>(many + 1) : most;
    }
    if (ends_segment || steps.count > most) steps.count = most;
    while (!find_last(steps)) steps.count = static_cast<uint8_t>(steps.count - (steps.count + 3u) / 4);
    if (ends_segment && steps.count == most) return steps;

    const uint32_t border_q16 = static_cast<uint32_t>(path_ticks) << 16;
    const uint32_t add = static_cast<uint32_t>(add_q16_);
    while (steps.last_q16 >= border_q16) {
        steps.interval_q16 -= add;
        steps.last_q16 -= steps.interval_q16;
        --steps.count;
    }
    while (steps.count != most && steps.interval_q16 < border_q16 - steps.last_q16) {
        steps.last_q16 += steps.interval_q16;
        steps.interval_q16 += add;
        ++steps.count;
    }
    return steps;
}

void Cursor::advance(const Steps& steps) {
    left_ = static_cast<uint16_t>(left_ - steps.count);
    const uint16_t last_low = static_cast<uint16_t>(steps.last_q16);
    at_.low = static_cast<uint16_t>(last_low + steps.interval_q16);
    at_.high += (steps.last_q16 >> 16) + (steps.interval_q16 >> 16) + (at_.low < last_low ? 1 : 0);
    interval_q16_ = steps.interval_q16 + static_cast<uint32_t>(add_q16_);
}

bool Cursor::take(const Slice& slice, Run& run) {
    Steps steps = steps_before(static_cast<uint16_t>(slice.end_path() - at_.high), slice.ends_segment());
    Intervals wanted = {interval_q16_, steps.interval_q16 - static_cast<uint32_t>(add_q16_)};
    const uint16_t first_path = slice.path_of(at_.high);
    const uint16_t last_path = static_cast<uint16_t>(first_path + (steps.last_q16 >> 16));
    if (steps.count > 1 && !slice.is_plain()) wanted = stretched(slice, wanted, first_path, last_path);

    run.positive = positive_;
    run.steps = steps.count;
    run.fraction = at_.low;
    run.interval_q16 = interval_q16_;
    run.add_q16 = static_cast<uint32_t>(add_q16_);
    run.first_ticks = slice.ticks_at(first_path);
    uint32_t last_ticks = slice.ticks_at(last_path);
    bool fits = steps.count == 1 || are_near(wanted);
    if (!slice.is_plain() && fits && steps.count > 1) {
        run.fraction = 0;
        fits = fit(run, last_ticks - run.first_ticks, wanted);
    }
    if (!fits) {
        steps.count = 1;
        find_last(steps);
    }
    if (steps.count == 1) {
        run.steps = 1;
        run.fraction = 0;
        last_ticks = run.first_ticks;
    }

    // From slice to slice the number of steps changes little: where one run makes them all it is a good
    // guess.
    const bool whole = steps.count != step_engine::MAX_RUN_STEPS && first_path <= interval_q16_ >> 16;
    guess_ = whole ? steps.count : 0;

    const bool near = has_moved_ && run.first_ticks - last_ticks_ <= MOST_AHEAD_TICKS;
    has_moved_ = true;
    last_ticks_ = last_ticks;
    last_path_ticks_ = at_.high + (steps.last_q16 >> 16);
    advance(steps);
    return near;
}

void Cursor::finish(uint32_t segment_ticks) { last_path_ticks_ -= segment_ticks; }

}  // namespace planarm
