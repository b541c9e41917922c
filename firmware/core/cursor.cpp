#include "cursor.h"

namespace planarm {

using path_clock::Slice;
using step_engine::Piece;

namespace {

// The longest interval inside a run, and the longest wait between two runs that the step interrupt bridges:
// the 16-bit timer must tell early from late.
constexpr uint32_t MOST_AHEAD_TICKS = 32000;
constexpr uint32_t MOST_AHEAD_Q16 = MOST_AHEAD_TICKS << 16;

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

// Intervals that bring `steps` steps over `span_ticks`, exactly, and grow as `wanted` does.
void fit(Piece& piece, uint32_t span_ticks, const Intervals& wanted) {
    const uint8_t intervals = static_cast<uint8_t>(piece.steps - 1);
    const uint32_t mean_q16 = hal::divide_q16(span_ticks, intervals);
    piece.interval_q16 = mean_q16;
    piece.add_q16 = 0;
    if (intervals == 1) return;
    const bool shrinks = wanted.last < wanted.first;
    const uint32_t growth = shrinks ? wanted.first - wanted.last : wanted.last - wanted.first;
    const uint8_t changes = static_cast<uint8_t>(intervals - 1);
    const uint32_t add = hal::divide_q16(growth >> 16, changes);  // whole ticks of the growth are enough
    const uint32_t half = multiply(add, changes).low / 2 + (multiply(add, changes).high << 15);
    piece.add_q16 = shrinks ? 0 - add : add;
    piece.interval_q16 = shrinks ? mean_q16 + half : mean_q16 - half;
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
    positive_ = move.positive;
}

bool Cursor::is_calm(const Slice& slice, uint32_t start_stop_ticks) const {
    if (!has_step_before(slice.end_path())) return true;
    uint32_t least = has_moved_ ? at_.high - last_path_ticks_ : 0xFFFFFFFF;
    if (slice.is_plain() && least < start_stop_ticks) return false;  // as a rule
    if (left_ > 1) {
        const uint32_t change = multiply(static_cast<uint32_t>(add_q16_ < 0 ? -add_q16_ : add_q16_),
                                         static_cast<uint16_t>(left_ - 2))
                                    .high;
        const uint32_t first = interval_q16_ >> 16;
        const uint32_t last = add_q16_ < 0 ? first - change - 1 : first;
        if (last < least) least = last;
    }
    return multiply_q16(least, slice.least_stretch()) >= start_stop_ticks;
}

// Newton's method on the steps' times, in whole steps. Where intervals shrink it comes nearer from below;
// where they grow it goes too far once and comes down from above. At one interval the first try is right.
uint8_t Cursor::steps_before(uint16_t path_ticks, bool ends_segment, Fixed48& to_last) const {
    const uint8_t most =
        left_ < step_engine::MAX_RUN_STEPS ? static_cast<uint8_t>(left_) : step_engine::MAX_RUN_STEPS;
    if (ends_segment) {
        to_last = run_time(static_cast<uint8_t>(most - 1), interval_q16_, add_q16_);
        return most;
    }
    to_last = {0, 0};
    uint8_t steps = 1;
    uint32_t interval = interval_q16_;  // to the step after those
    const uint32_t add = static_cast<uint32_t>(add_q16_);
    for (;;) {
        const int32_t room = static_cast<int32_t>(path_ticks - ticks_to(to_last));
        if (room > 0) {
            if (steps == most) return steps;
            // Rounded so that at one interval the last of these steps is still before the border.
            const uint16_t whole = static_cast<uint16_t>(interval >> 16);
            uint16_t more = static_cast<uint16_t>(static_cast<uint16_t>(room - 1) / (whole + 1u));
            if (more > static_cast<uint8_t>(most - steps)) more = static_cast<uint8_t>(most - steps);
            Fixed48 time = more < 2 ? Fixed48{whole, static_cast<uint16_t>(interval)}
                                    : run_time(static_cast<uint8_t>(more), interval, add_q16_);
            if (more == 0) {
                more = 1;
                Fixed48 next = to_last;
                add_to(next, time);
                if (ticks_to(next) >= path_ticks) return steps;
            }
            add_to(to_last, time);
            interval += add * static_cast<uint8_t>(more);
            steps = static_cast<uint8_t>(steps + more);
        } else {
            interval -= add;
            const uint32_t beyond = static_cast<uint32_t>(-room) / ((interval >> 16) + 1);
            const uint8_t less = beyond == 0 ? 1 : static_cast<uint8_t>(beyond);
            subtract_from(to_last, run_time(less, interval, -add_q16_));
            interval -= add * static_cast<uint8_t>(less - 1);
            steps = static_cast<uint8_t>(steps - less);
        }
    }
}

void Cursor::advance(uint8_t steps, Fixed48 to_last) {
    left_ = static_cast<uint16_t>(left_ - steps);
    if (left_ == 0) return;
    const uint32_t grown = static_cast<uint32_t>(add_q16_) * static_cast<uint8_t>(steps - 1);
    const uint32_t interval = interval_q16_ + grown;
    add_to(to_last, {interval >> 16, static_cast<uint16_t>(interval)});
    add_to(at_, to_last);
    interval_q16_ = interval + static_cast<uint32_t>(add_q16_);
}

Piece Cursor::take(const Slice& slice) {
    Piece piece;
    piece.positive = positive_;
    piece.fraction = at_.low;
    piece.interval_q16 = interval_q16_;
    piece.add_q16 = static_cast<uint32_t>(add_q16_);
    Fixed48 to_last;
    const uint16_t to_border = static_cast<uint16_t>(slice.end_path() - at_.high);
    piece.steps = steps_before(to_border, slice.ends_segment(), to_last);
    const uint16_t first_path = slice.path_of(at_.high);
    piece.first_ticks = slice.ticks_at(first_path);
    uint32_t last_ticks = piece.first_ticks;
    if (piece.steps > 1) {
        Fixed48 last = at_;
        add_to(last, to_last);
        const uint16_t last_path = slice.path_of(last.high);
        last_ticks = slice.ticks_at(last_path);
        const uint32_t grown = static_cast<uint32_t>(add_q16_) * static_cast<uint8_t>(piece.steps - 2);
        Intervals wanted = {interval_q16_, interval_q16_ + grown};
        if (!slice.is_plain()) wanted = stretched(slice, wanted, first_path, last_path);
        if (!are_near(wanted)) {
            piece.steps = 1;
            to_last = {0, 0};
            last_ticks = piece.first_ticks;
        } else if (!slice.is_plain()) {
            piece.fraction = 0;
            fit(piece, last_ticks - piece.first_ticks, wanted);
        }
    }
    if (piece.steps == 1) piece.fraction = 0;

    piece.near = has_moved_ && piece.first_ticks - last_ticks_ <= MOST_AHEAD_TICKS;
    has_moved_ = true;
    last_ticks_ = last_ticks;
    last_path_ticks_ = at_.high + to_last.high;
    const uint16_t fraction = static_cast<uint16_t>(at_.low + to_last.low);
    if (fraction < at_.low) ++last_path_ticks_;
    advance(piece.steps, to_last);
    return piece;
}

void Cursor::finish(uint32_t segment_ticks) { last_path_ticks_ -= segment_ticks; }

}  // namespace planarm
