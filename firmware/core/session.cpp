#include "session.h"

#include "commands.h"
#include "motion.h"
#include "reply.h"
#include "supervisor.h"

namespace planarm {
namespace session {

using supervisor::Event;
using wire::Fault;
using wire::MessageType;
using wire::Result;

namespace {

bool is_open;  // a HELLO with the right version came: the sequence is defined
uint8_t expected_seq;
Result refusal;
uint8_t refusal_seq;
uint8_t crc_errors;
uint32_t host_nonce;
bool welcome_due;
bool status_due;

bool checking;  // a SEGMENTS frame is being carried out, segment by segment
const uint8_t* payload;
uint8_t payload_bytes;

void note_refusal(Result result, uint8_t seq) {
    if (static_cast<int8_t>(result) >= 0 || refusal != Result::OK) return;
    refusal = result;
    refusal_seq = seq;
}

// Ends the frame that was expected: it counts as carried out unless it is to be sent again.
void finish(Result result) {
    status_due = true;
    if (result == Result::BUSY) return;
    note_refusal(result, expected_seq);
    ++expected_seq;
}

void hello(const Frame& frame) {
    Reader fields(frame.payload, frame.length);
    const uint8_t version = fields.u8();
    const uint32_t nonce = fields.u32();
    if (!fields.ok() || !fields.at_end()) {
        note_refusal(Result::MALFORMED, frame.seq);
        status_due = true;
        return;
    }
    host_nonce = nonce;
    expected_seq = static_cast<uint8_t>(frame.seq + 1);
    refusal = Result::OK;
    refusal_seq = 0;
    is_open = version == wire::PROTOCOL_VERSION;
    if (!is_open) note_refusal(Result::VERSION, frame.seq);
    welcome_due = true;
}

Result fail(Result result, Fault fault, uint8_t detail, uint32_t now_ticks) {
    supervisor::fail(fault, detail, now_ticks);
    return result;
}

// Checks the next segment of the frame, or queues all after the last. True when the frame is done, with its
// result.
bool next_segment(Result& result, uint32_t now_ticks) {
    if (!supervisor::allows(Event::SEGMENTS)) {
        result = Result::WRONG_STATE;
        return true;
    }
    result = motion::check_next();
    if (result == Result::WRONG_STATE) {
        result = fail(result, Fault::QUEUE_MISUSE, 0, now_ticks);
        return true;
    }
    if (result != Result::OK) {  // a motion with a segment left out must not go on
        result = fail(result, Fault::BAD_SEGMENT, 0, now_ticks);
        return true;
    }
    if (motion::joint_out_of_limits() != wire::JOINTS) {
        result = fail(Result::OUT_OF_RANGE, Fault::SOFT_LIMIT, motion::joint_out_of_limits(), now_ticks);
        return true;
    }
    if (!motion::is_checked()) return false;
    if (!motion::commit(payload, payload_bytes)) result = Result::WRONG_STATE;
    return true;
}

// Begins with a SEGMENTS frame: what can be told of it as a whole.
void begin_segments(const Frame& frame, uint32_t now_ticks) {
    if (!supervisor::allows(Event::SEGMENTS)) return finish(Result::WRONG_STATE);
    if (motion::is_complete()) return finish(fail(Result::WRONG_STATE, Fault::QUEUE_MISUSE, 0, now_ticks));
    const Result result = motion::begin_check(frame.payload, frame.length);
    if (result == Result::BUSY) return finish(result);
    if (result != Result::OK) return finish(fail(result, Fault::BAD_SEGMENT, 0, now_ticks));
    payload = frame.payload;
    payload_bytes = frame.length;
    checking = true;
}

void execute(const Frame& frame, uint32_t now_ticks) {
    if (static_cast<MessageType>(frame.type) == MessageType::SEGMENTS)
        return begin_segments(frame, now_ticks);
    Reader fields(frame.payload, frame.length);
    const Result result = commands::execute(static_cast<MessageType>(frame.type), fields, now_ticks);
    if (result == Result::OK && static_cast<MessageType>(frame.type) == MessageType::CLEAR) {
        refusal = Result::OK;
        refusal_seq = 0;
    }
    finish(result);
}

}  // namespace

void reset() {
    is_open = false;
    expected_seq = 0;
    refusal = Result::OK;
    refusal_seq = 0;
    crc_errors = 0;
    welcome_due = status_due = checking = false;
}

void on_frame(const Frame& frame, uint32_t now_ticks) {
    if (static_cast<MessageType>(frame.type) == MessageType::HELLO) {
        hello(frame);
    } else if (is_open && frame.seq == expected_seq) {
        execute(frame, now_ticks);
    } else {
        status_due = true;
    }
}

void on_damage() {
    ++crc_errors;
    status_due = true;
}

bool is_busy() { return checking; }

void advance(uint32_t now_ticks) {
    Result result;
    if (!next_segment(result, now_ticks)) return;
    checking = false;
    finish(result);
}

void announce() { status_due = true; }

Report report() { return {expected_seq, refusal, refusal_seq, crc_errors}; }

uint8_t take_reply(uint8_t* encoded) {
    if (welcome_due) {
        welcome_due = false;
        return reply::welcome(encoded, report(), host_nonce);
    }
    if (status_due) {
        status_due = false;
        return reply::status(encoded, report());
    }
    return 0;
}

}  // namespace session
}  // namespace planarm
