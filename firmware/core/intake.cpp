#include "intake.h"

#include "fixed.h"
#include "hal_base.h"
#include "queue.h"
#include "segment.h"
#include "settings.h"

namespace planarm {
namespace intake {

namespace {

// What the segments after the last queued one go on from.
struct QueueEnd {
    JointEnd joints[wire::JOINTS];
    bool complete;
};

struct Check {
    Reader reader;
    uint32_t path_ticks;
    QueueEnd end;
    uint8_t joint_out;
};

struct Queued {
    uint32_t path_ticks;
    QueueEnd end;
};

Queued queued;
Check checked;

// A segment of ENOUGH_TICKS takes six bytes at least.
static_assert(static_cast<uint64_t>(wire::QUEUE_BYTES / 6) * ENOUGH_TICKS + wire::MAX_SEGMENT_TICKS <
                  0xFFFFFFFF,
              "32 bits hold what is queued, and the segment in progress");
uint32_t counted(uint32_t ticks) { return least_of(ticks, ENOUGH_TICKS); }

[[gnu::noinline]] bool is_out_of_limits(uint8_t joint, int32_t usteps) {
    const wire::SoftLimits& limits = hal::by_base(settings::soft_limits);
    const int32_t least_usteps = limits.least_usteps[joint];
    const int32_t most_usteps = limits.most_usteps[joint];
    return least_usteps <= most_usteps && (usteps < least_usteps || usteps > most_usteps);
}

}  // namespace

void reset(const step_engine::Position& position) {
    Queued& at = hal::by_base(queued);
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        at.end.joints[joint] = {JointEnd::FOREVER, position.usteps[joint], false};
    }
    at.end.complete = false;
    at.path_ticks = 0;
}

void set_position(uint8_t joint, int32_t usteps) { queued.end.joints[joint].usteps = usteps; }

wire::Result begin_check(const uint8_t* bytes, uint8_t length) {
    if (queued.end.complete) return wire::Result::WRONG_STATE;
    if (length > queue::free_bytes()) return wire::Result::BUSY;
    Check& at = hal::by_base(checked);
    if (length <= SEGMENTS_HEAD_BYTES) return wire::Result::MALFORMED;
    at.reader.begin(bytes + SEGMENTS_HEAD_BYTES, static_cast<uint8_t>(length - SEGMENTS_HEAD_BYTES));
    at.path_ticks = 0;
    at.end = queued.end;
    at.joint_out = wire::JOINTS;
    return wire::Result::OK;
}

wire::Result check_next() {
    Check& at = hal::by_base(checked);
    if (at.end.complete) return wire::Result::WRONG_STATE;
    SegmentHead head;
    read_head(at.reader, head);
    bool good = head.duration_ticks != 0 && head.duration_ticks <= wire::MAX_SEGMENT_TICKS;
    uint8_t joint = 0;
    for (JointEnd& end : at.end.joints) {
        Move move;
        read_move(at.reader, move);
        good = good && check_move(move, head.duration_ticks, end);
        if (move.count != 0 && is_out_of_limits(joint, end.usteps)) at.joint_out = joint;
        ++joint;
    }
    if (!at.reader.ok()) return wire::Result::MALFORMED;
    if (!good) return wire::Result::OUT_OF_RANGE;
    increase(at.path_ticks, counted(head.duration_ticks));
    at.end.complete = head.last;
    return wire::Result::OK;
}

bool is_checked() { return checked.reader.at_end(); }

uint8_t joint_out_of_limits() { return checked.joint_out; }

void commit(const uint8_t* bytes, uint8_t length) {
    queue::append(bytes, length);
    increase(queued.path_ticks, checked.path_ticks);
    queued.end = checked.end;
}

bool is_complete() { return queued.end.complete; }

uint32_t path_ticks() { return hal::by_base(queued).path_ticks; }

void begin_segment(uint32_t ticks) { increase(queued.path_ticks, 0 - counted(ticks)); }

}  // namespace intake
}  // namespace planarm
