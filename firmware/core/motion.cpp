#include "motion.h"

#include "clock.h"
#include "step_engine.h"

namespace planarm {
namespace motion {

namespace {

// A segment is prepared this long before its start at the earliest, so that the end of what is prepared stays
// near enough for its time to compare rightly.
constexpr int32_t PREPARE_AHEAD_TICKS = 0x100000;

// The first segment to be prepared must have come this long before its start: 1.25 ms, in which a pass of the
// main program ends at the latest, with both joints at the least interval, and the joint gets its DIR.
constexpr int32_t LATEST_ARRIVAL_TICKS = 20000;

static_assert((wire::QUEUE_SLOTS & (wire::QUEUE_SLOTS - 1)) == 0, "slot indices wrap by a mask");

Segment slots[wire::QUEUE_SLOTS];
uint8_t oldest;    // index of the oldest queued segment
uint8_t queued;    // segments committed and not yet executed
uint8_t prepared;  // of these, handed to the step engine
uint8_t staged;    // segments behind the queued ones, not yet committed

Rest queue_rest;   // at the end of the queue
Rest staged_rest;  // at the end of the staged segments

bool running;
uint32_t oldest_end_ticks;     // end of the oldest prepared segment
uint32_t prepare_start_ticks;  // start of the next segment to be prepared
uint32_t executed_segments;

Segment& slot(uint8_t position) { return slots[(oldest + position) & (wire::QUEUE_SLOTS - 1)]; }

bool has_come(uint32_t ticks, uint32_t now_ticks) { return static_cast<int32_t>(now_ticks - ticks) >= 0; }

void prepare_next(uint32_t now_ticks) {
    if (prepared == queued) return;
    if (static_cast<int32_t>(prepare_start_ticks - now_ticks) > PREPARE_AHEAD_TICKS) return;
    const Segment& segment = slot(prepared);
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        if (segment.moves[joint].steps != 0 && !step_engine::has_room(joint)) return;
    }
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        const Move& move = segment.moves[joint];
        if (move.steps != 0) step_engine::append(joint, move, prepare_start_ticks);
    }
    prepare_start_ticks += segment.duration_ticks;
    if (prepared == 0) oldest_end_ticks = prepare_start_ticks;
    ++prepared;
}

// Takes executed segments off the queue. True when the last of them ended the motion's data, as far as
// received.
bool retire(uint32_t now_ticks) {
    while (prepared != 0 && has_come(oldest_end_ticks, now_ticks)) {
        oldest = static_cast<uint8_t>((oldest + 1) & (wire::QUEUE_SLOTS - 1));
        --queued;
        --prepared;
        ++executed_segments;
        if (queued == 0) return true;
        oldest_end_ticks += slot(0).duration_ticks;
    }
    return false;
}

}  // namespace

void reset() {
    step_engine::reset();
    oldest = queued = prepared = staged = 0;
    queue_rest = staged_rest = Rest();
    running = false;
    executed_segments = 0;
}

bool is_complete() {
    const uint8_t filled = static_cast<uint8_t>(queued + staged);
    return filled != 0 && slot(static_cast<uint8_t>(filled - 1)).last;
}

wire::Result stage(Reader& reader) {
    const uint8_t filled = static_cast<uint8_t>(queued + staged);
    if (filled == wire::QUEUE_SLOTS) return wire::Result::BUSY;
    Segment& segment = slot(filled);
    read_segment(reader, segment);
    if (!reader.ok()) return wire::Result::MALFORMED;
    const wire::Result result = check_segment(segment, staged_rest);
    if (result == wire::Result::OK) ++staged;
    return result;
}

bool commit() {
    const bool starving = running && prepared == queued;
    if (starving && static_cast<int32_t>(prepare_start_ticks - clock::now()) < LATEST_ARRIVAL_TICKS) {
        discard();
        return false;
    }
    queued = static_cast<uint8_t>(queued + staged);
    staged = 0;
    queue_rest = staged_rest;
    return true;
}

void discard() {
    staged = 0;
    staged_rest = queue_rest;
}

bool is_empty() { return queued == 0; }

uint8_t free_slots() { return static_cast<uint8_t>(wire::QUEUE_SLOTS - queued); }

void start(uint32_t start_ticks) {
    prepare_start_ticks = start_ticks;
    running = true;
}

Progress serve(uint32_t now_ticks) {
    if (!running) return Progress::GOING;
    if (!step_engine::serve(now_ticks)) return Progress::MISSED;
    prepare_next(now_ticks);
    const bool was_last = slot(static_cast<uint8_t>(queued - 1)).last;
    if (!retire(now_ticks)) return Progress::GOING;
    running = false;
    queue_rest = staged_rest = Rest();
    return was_last ? Progress::DONE : Progress::UNDERRUN;
}

void halt(uint32_t now_ticks) {
    if (running && !step_engine::missed()) retire(now_ticks);
    step_engine::stop();
    oldest = queued = prepared = staged = 0;
    queue_rest = staged_rest = Rest();
    running = false;
}

Ledger ledger() {
    const step_engine::Position position = step_engine::position();
    Ledger ledger;
    ledger.ticks = clock::extend(position.counter);
    ledger.executed_segments = executed_segments;
    // After a missed step the clock no longer tells what was executed.
    const uint8_t timely = step_engine::missed() ? 0 : prepared;
    uint32_t end_ticks = oldest_end_ticks;
    for (uint8_t i = 0; i < timely && has_come(end_ticks, ledger.ticks); ++i) {
        ++ledger.executed_segments;
        end_ticks += slot(static_cast<uint8_t>(i + 1)).duration_ticks;
    }
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint)
        ledger.position_usteps[joint] = position.usteps[joint];
    return ledger;
}

}  // namespace motion
}  // namespace planarm
