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

// About steps part / whole, for 0 < part <= whole: bit by bit, in 14 bits of both.
uint8_t share(uint8_t steps, uint32_t part, uint32_t whole) {
    while (whole > 0x3FFF) {
        whole >>= 1;
        part >>= 1;
    }
    const uint16_t term = static_cast<uint16_t>(part);
    const uint16_t divisor = static_cast<uint16_t>(whole);
    uint16_t rest = 0;
    uint8_t quotient = 0;
    for (uint8_t bit = 0x80; bit != 0; bit = static_cast<uint8_t>(bit >> 1)) {
        rest = static_cast<uint16_t>(2 * rest + ((steps & bit) != 0 ? term : 0u));
        quotient = static_cast<uint8_t>(2 * quotient);
        while (rest >= divisor) {
            rest = static_cast<uint16_t>(rest - divisor);
            ++quotient;
        }
    }
    return quotient;
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

// Mostly the guess is right, and one look at each side of it shows that; else by halving.
uint8_t Cursor::steps_before(uint32_t path_ticks, bool ends_segment, Fixed48& to_last) const {
    const uint8_t most =
        left_ < step_engine::MAX_RUN_STEPS ? static_cast<uint8_t>(left_) : step_engine::MAX_RUN_STEPS;
    to_last = run_time(static_cast<uint8_t>(most - 1), interval_q16_, add_q16_);
    if (ends_segment || reaches(to_last) < path_ticks) return most;
    uint8_t fits = 1;
    uint8_t fails = most;
    uint8_t probe =
        static_cast<uint8_t>(1 + share(static_cast<uint8_t>(most - 1), path_ticks - at_.high, to_last.high));
    to_last = {0, 0};
    if (probe <= fits) probe = 2;
    if (probe >= fails) probe = static_cast<uint8_t>(fails - 1);
    for (uint8_t turn = 0; fails - fits > 1; ++turn) {
        const Fixed48 time = run_time(static_cast<uint8_t>(probe - 1), interval_q16_, add_q16_);
        const bool before = reaches(time) < path_ticks;
        if (before) {
            fits = probe;
            to_last = time;
        } else {
            fails = probe;
        }
        const uint8_t beside = static_cast<uint8_t>(before ? probe + 1 : probe - 1);
        const bool inside = fits < beside && beside < fails;
        const uint8_t middle = static_cast<uint8_t>(fits + static_cast<uint8_t>(fails - fits) / 2);
        probe = turn < 2 && inside ? beside : middle;
    }
    return fits;
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
    piece.steps = steps_before(slice.end_path(), slice.ends_segment(), to_last);
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
