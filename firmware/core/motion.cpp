#include "motion.h"

#include "clock.h"
#include "cursor.h"
#include "hal_base.h"
#include "intake.h"
#include "path_clock.h"
#include "queue.h"
#include "segment.h"
#include "settings.h"
#include "step_engine.h"

namespace planarm {
namespace motion {

using path_clock::ONE;
using path_clock::Slice;

namespace {

// A slice is prepared this long before its start: 3.5 ms, in which the main program hands over the runs of
// all joints at the board's rate after the longest of its other jobs. No earlier, so that a hold takes effect
// soon.
constexpr int32_t PREPARE_AHEAD_TICKS = wire::MIN_LEAD_TICKS;

// How time is kept for slices whose stretch changes, where joints are fast. Such a slice takes the main
// program up to 48,000 ticks, a pass that looks at the line up to 18,000: not both fit into the time that a
// slice lasts. Time is short when the last run of such a slice is begun with less than SHORT_TICKS left, and
// from a new wish until the first one. Then the line waits when the next slice is due within a pass of it; it
// is looked at all the same when it has not been for UNSEEN_SLICES. And the first slice after a new wish does
// not begin a change when it is begun later than LATE_TICKS; one that is stretched already is slowed down by
// all of its rates then, until there is time again.
constexpr int32_t SHORT_TICKS = 36000;
constexpr int32_t LATE_TICKS = 51000;
constexpr int32_t LINE_PASS_TICKS = 18000;
constexpr uint8_t UNSEEN_SLICES = 3;

// Segments must have come this long before they start: 2.5 ms.
constexpr int32_t LATEST_ARRIVAL_TICKS = 40000;

// After a rest on the path the joints start so long after they are told to: the slice in which the clock
// stood may be about to end, and the next one is prepared by then, and DIR pins are set.
constexpr uint32_t THAW_LEAD_TICKS = wire::MIN_LEAD_TICKS;

// A payload that still fits means that more can come.
constexpr uint16_t FULL_BYTES = wire::MAX_PAYLOAD_BYTES;

// In units of a need.
constexpr uint8_t STARVING_MARGIN = wire::STARVING_TICKS / wire::NEED_UNIT_TICKS;
static_assert(wire::STARVING_TICKS % wire::NEED_UNIT_TICKS == 0, "whole units");
// A product with it, less its low 16 bits, divides by the unit.
constexpr uint16_t NEEDS_A_LAP = 0x10000 / wire::NEED_UNIT_TICKS;
static_assert(NEEDS_A_LAP * static_cast<uint32_t>(wire::NEED_UNIT_TICKS) == 0x10000, "whole needs");

// A step that comes soon passes while a rest is tried again; some 150 ticks each.
constexpr uint8_t FREEZE_TRIES = 20;

constexpr uint8_t MAX_SLICES = 4;

// Newly: by a new wish, and no slice was begun since.
enum class Time : uint8_t { ENOUGH, SHORT, SHORT_NEWLY };

// Slices handed over and not yet executed, oldest first.
struct Prepared {
    uint32_t end_ticks;
    bool ends_segment;
    bool calm;
};

Prepared prepared[MAX_SLICES];
Cursor cursors[wire::JOINTS];
Reader payload;  // the oldest, being read

class Motion {
  public:
    // What the functions of the same names in motion.h tell.
    void reset();
    void start(uint32_t start_ticks);
    void set_wish(Wish wished) {
        wish = wished;
        urgent = true;
        if (slice.is_plain()) time = Time::SHORT_NEWLY;
    }
    void set_override(uint8_t to_percent);
    uint8_t override_percent() const { return percent; }
    uint8_t rate_percent() const;
    bool is_urgent() const { return running && !frozen && urgent; }
    Progress serve();
    void halt();
    uint32_t tell_ledger(wire::Ledger& ledger) const;

    bool is_too_late() const;

  private:
    bool is_in_segment() const { return filling || left_ticks != 0; }
    bool is_starving(uint8_t margin) const;
    bool must_line_wait() const;
    void read_next_segment();
    void open_slice(bool late);
    bool fill_slice();
    void prepare();
    Progress retire();
    void clear();
    void thaw();
    bool may_freeze() const;
    Progress serve_frozen();
    Progress freeze_if_due();

    Slice slice;  // being filled, or the last one filled

    bool running;
    bool begun;  // the first slice
    bool frozen;
    bool starved;  // frozen because the queue ran low

    Wish wish;
    uint8_t percent;
    uint32_t override_stretch;

    bool reading;  // a payload
    uint8_t need;  // in NEED_UNIT_TICKS

    bool segment_last;
    uint32_t left_ticks;  // of the segment, in no slice yet

    Time time;
    bool filling;    // a slice
    uint8_t unseen;  // slices since the line was looked at, but for those behind which a segment is read
    bool urgent;     // more is to be handed over before the line is looked at
    uint8_t turn;    // the joint whose run was handed over last
    uint8_t prepared_count;
    uint32_t frozen_ticks;
    uint32_t executed_segments;
    uint32_t begin_ticks;  // start of the motion
};

Motion motion;

Motion& current() { return hal::by_base(motion); }

// True when the path that is left after the slice is too short to rest on, and `margin` of NEED_UNIT_TICKS
// more.
bool Motion::is_starving(uint8_t margin) const {
    if (intake::is_complete() || segment_last || queue::free_bytes() < FULL_BYTES) return false;
    const uint32_t road_ticks = intake::path_ticks() + left_ticks;
    return multiply_high(road_ticks, NEEDS_A_LAP) < static_cast<uint32_t>(need) + margin;
}

// From the planned pace it waits a slice before the path is too short, too: then the clock is slowed down in
// time.
bool Motion::must_line_wait() const {
    if (unseen >= UNSEEN_SLICES) return false;
    return time != Time::ENOUGH ||
           (slice.is_plain() && (wish != Wish::GO || is_starving(2 * STARVING_MARGIN)));
}

// Apart from serve, whose frame on the stack lies below the deepest calls.
[[gnu::noinline]] void Motion::read_next_segment() {
    if (!reading) {
        if (queue::is_empty()) return;
        queue::read_front(payload);
        slice.way().rates.slow = payload.u8();
        slice.way().rates.fast = payload.u8();
        need = payload.u8();
        reading = true;
    }
    SegmentHead head;
    read_head(payload, head);
    for (Cursor& cursor : cursors) {
        Move move;
        read_move(payload, move);
        cursor.begin(move);
    }
    if (payload.at_end()) {
        queue::release();
        reading = false;
    }
    left_ticks = head.duration_ticks;
    segment_last = head.last;
    intake::begin_segment(left_ticks);
}

// A slice is half as long with each doubling of the stretch, so that the clock comes to rest, and goes on, as
// soon as the rates let it. Short ones take the main program as long as others: the last two of a segment are
// alike, while the clock is stretched the last one may be up to twice as long.
uint16_t next_slice_ticks(uint32_t left_ticks, const Slice& before) {
    uint16_t ticks = wire::SLICE_TICKS;
    uint16_t stretch = static_cast<uint16_t>(before.end_stretch() >> 16);
    uint32_t most = ticks;
    if (stretch < 2) {
        if (left_ticks > ticks) left_ticks = (left_ticks + 1) >> 1;
    } else {
        do {
            ticks >>= 1;
        } while ((stretch >>= 1) != 1);
        most = static_cast<uint16_t>(2 * ticks - 1);
    }
    return left_ticks <= most ? static_cast<uint16_t>(left_ticks) : ticks;
}

// `late`: LATE_TICKS.
[[gnu::noinline]] void Motion::open_slice(bool late) {
    path_clock::Way& way = slice.way();
    const uint16_t ticks = next_slice_ticks(left_ticks, slice);
    if (ticks != way.path_ticks) {
        for (Cursor& cursor : cursors) cursor.forget_guess();
    }
    way.path_ticks = ticks;
    way.ends_segment = left_ticks == way.path_ticks;
    left_ticks -= way.path_ticks;
    way.gently = !(late || wish == Wish::REST_QUICKLY || is_starving(STARVING_MARGIN));
    uint32_t target = override_stretch;
    if (!way.gently || wish == Wish::REST) target = path_clock::MAX_STRETCH;
    if (late && slice.is_plain()) target = slice.end_stretch();
    way.target = target;
    slice.follow();
    Prepared& entry = hal::by_base(prepared[prepared_count++]);
    entry.end_ticks = slice.end_ticks();
    entry.ends_segment = way.ends_segment;
    entry.calm = true;
    for (uint8_t joint = 0; joint < wire::JOINTS && entry.calm; ++joint) {
        entry.calm = cursors[joint].is_calm(slice, settings::config.start_stop_ticks[joint]);
    }
    filling = true;
    if (!way.ends_segment) ++unseen;
}

// Hands runs over, of two joints in their turn; while the clock is stretched, when one takes long, of one.
// True when nothing of the slice is left.
[[gnu::noinline]] bool Motion::fill_slice() {
    bool more = false;
    uint8_t runs = slice.is_plain() ? 2 : 1;
    uint8_t joint = turn;
    for (uint8_t i = 0; i < wire::JOINTS; ++i) {
        joint = joint == wire::JOINTS - 1 ? 0 : static_cast<uint8_t>(joint + 1);
        Cursor& cursor = hal::by_base(cursors[joint]);
        if (!cursor.has_step_in(slice)) continue;
        if (runs != 0 && step_engine::has_room(joint)) {
            --runs;
            step_engine::append(joint, cursor.take(slice, step_engine::next_run(joint)));
            urgent = true;
            turn = joint;
        }
        more = more || cursor.has_step_in(slice);
    }
    if (more) return false;
    for (Cursor& cursor : cursors) cursor.finish(slice);
    return true;
}

// A stretched slice takes much longer than a plain one: each pass that does something for it leaves the line
// to a later one.
[[gnu::noinline]] void Motion::prepare() {
    const bool stretched = !slice.is_plain();
    if (!urgent) unseen = 0;
    urgent = false;
    if (!filling) {
        if (left_ticks == 0) {  // as a rule ahead of time
            read_next_segment();
            urgent = stretched && left_ticks != 0;
            if (left_ticks == 0 || urgent) return;
        }
        if (prepared_count == MAX_SLICES) return;
        const int32_t away_ticks = clock::ticks_until(slice.end_ticks());
        if (away_ticks > PREPARE_AHEAD_TICKS) {
            urgent = away_ticks < PREPARE_AHEAD_TICKS + LINE_PASS_TICKS && must_line_wait();
            return;
        }
        // Not late where no more slices than that can be ahead.
        const bool late = time >= (stretched ? Time::SHORT : Time::SHORT_NEWLY) && away_ticks < LATE_TICKS &&
                          prepared_count != MAX_SLICES - 1;
        open_slice(late);
        time = late ? Time::SHORT : Time::ENOUGH;
    }
    filling = !fill_slice();
    if (!slice.is_plain()) {
        time = clock::ticks_until(slice.start_ticks()) < SHORT_TICKS ? Time::SHORT : Time::ENOUGH;
    }
    urgent = urgent && (filling || stretched);
}

// Takes executed slices off the list. When the last of them ended what was received, so does the motion.
Progress Motion::retire() {
    while (prepared_count != 0 && clock::has_come(prepared[0].end_ticks)) {
        // The last steps of joints 3 and 4 may rise some hundred ticks after their own.
        if (prepared_count == 1 && !step_engine::is_idle()) return Progress::GOING;
        if (prepared[0].ends_segment) ++executed_segments;
        --prepared_count;
        for (uint8_t i = 0; i < MAX_SLICES - 1; ++i) prepared[i] = prepared[i + 1];
        if (prepared_count == 0 && !is_in_segment() && queue::is_empty()) {
            const bool done = segment_last;
            clear();
            return done ? Progress::DONE : Progress::UNDERRUN;
        }
    }
    return Progress::GOING;
}

void Motion::clear() {
    queue::clear();
    intake::reset(step_engine::position());
    left_ticks = 0;
    need = 0;  // a motion does not starve by the last one's need before it has read its own
    running = begun = reading = segment_last = filling = frozen = starved = false;
    wish = Wish::GO;
    slice.begin_with(override_stretch);
    prepared_count = 0;
    for (Cursor& cursor : cursors) cursor.reset();
    clock::end_standing();
}

void Motion::thaw() {
    clock::stand_before(frozen_ticks - THAW_LEAD_TICKS);
    frozen = starved = false;
}

// True when the slice that is being executed lets the joints stop dead, or none is yet.
bool Motion::may_freeze() const {
    if (!begun) return true;
    return prepared_count != 0 && prepared[0].calm;
}

[[gnu::noinline]] Progress Motion::serve_frozen() {
    if (wish != Wish::GO) {
        if (!starved) return Progress::GOING;
        starved = false;
        return Progress::AT_REST;
    }
    if (starved && is_starving(2 * STARVING_MARGIN)) return Progress::GOING;
    const bool was_starved = starved;
    thaw();
    return was_starved ? Progress::FED : Progress::GOING;
}

[[gnu::noinline]] Progress Motion::freeze_if_due() {
    const bool starving = wish == Wish::GO && is_starving(STARVING_MARGIN);
    if (wish == Wish::GO && !starving) return Progress::GOING;
    if (!may_freeze()) return Progress::GOING;
    for (uint8_t tries = FREEZE_TRIES; !step_engine::freeze(frozen_ticks);) {
        if (--tries == 0) return Progress::GOING;
    }
    clock::begin_pass_at(frozen_ticks);
    frozen = true;
    starved = starving;
    return starving ? Progress::STARVED : Progress::AT_REST;
}

void Motion::reset() {
    step_engine::reset();
    set_override(100);
    executed_segments = 0;
    urgent = false;
    turn = 0;
    clear();
}

void Motion::start(uint32_t start_ticks) {
    begin_ticks = start_ticks;
    slice.begin_at(start_ticks);
    slice.begin_with(override_stretch);
    running = true;
}

void Motion::set_override(uint8_t to_percent) {
    percent = to_percent;
    override_stretch = (100 * ONE) / to_percent;
    if (slice.is_plain()) time = Time::SHORT_NEWLY;
}

uint8_t Motion::rate_percent() const {
    if (frozen) return 0;
    if (slice.end_stretch() == ONE) return 100;  // as a rule, without the 600 cycles of a division
    return static_cast<uint8_t>((100 * ONE) / slice.end_stretch());
}

Progress Motion::serve() {
    if (!running) return Progress::GOING;
    if (frozen) return serve_frozen();
    begun = begun || clock::has_come(begin_ticks);
    if (!step_engine::serve()) return Progress::MISSED;
    Progress ended = retire();
    if (ended != Progress::GOING) return ended;
    const Progress rest = freeze_if_due();
    if (rest == Progress::GOING) {
        prepare();  // last, as it takes longest: the pass has one time
        return rest;
    }
    ended = retire();  // what ended before the clock stood is executed
    return ended != Progress::GOING ? ended : rest;
}

void Motion::halt() {
    clock::begin_pass();                             // a pass that writes the EEPROM may be long
    clock::begin_pass_at(step_engine::end_steps());  // the segments whose steps have risen are executed
    // Asked after the end: behind a step that was missed until then nothing has risen.
    if (running && !frozen && !step_engine::missed()) retire();
    step_engine::drop_runs();
    clear();
}

uint32_t Motion::tell_ledger(wire::Ledger& ledger) const {
    const step_engine::Position position = step_engine::position();
    const uint32_t ticks = clock::extend(position.counter);
    uint32_t segments = executed_segments;
    // After a missed step, and while the path clock stands, time does not tell what was executed.
    const uint8_t timely = step_engine::missed() || frozen ? 0 : prepared_count;
    for (uint8_t i = 0; i < timely && static_cast<int32_t>(prepared[i].end_ticks - ticks) <= 0; ++i) {
        if (prepared[i].ends_segment) ++segments;
    }
    ledger.executed_segments = segments;
    __builtin_memcpy(ledger.position_usteps, position.usteps, sizeof(position.usteps));
    return clock::device_ticks(ticks);
}

bool Motion::is_too_late() const {
    clock::begin_pass();  // the pass may have begun long ago
    return running && !frozen && !is_in_segment() && queue::is_empty() &&
           clock::ticks_until(slice.end_ticks()) < LATEST_ARRIVAL_TICKS;
}

}  // namespace

void reset() { current().reset(); }

void start(uint32_t start_ticks) { current().start(start_ticks); }

void set_wish(Wish wish) { current().set_wish(wish); }

void set_override(uint8_t percent) { current().set_override(percent); }

uint8_t override_percent() { return current().override_percent(); }

uint8_t rate_percent() { return current().rate_percent(); }

Progress serve() { return current().serve(); }

void halt() { current().halt(); }

uint32_t tell_ledger(wire::Ledger& ledger) { return current().tell_ledger(ledger); }

bool is_urgent() { return current().is_urgent(); }

bool is_too_late() { return current().is_too_late(); }

}  // namespace motion
}  // namespace planarm
