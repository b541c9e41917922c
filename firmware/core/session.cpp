#include "session.h"

#include "motion.h"
#include "reader.h"
#include "reply.h"
#include "supervisor.h"

namespace planarm {
namespace session {

using supervisor::Command;
using wire::Fault;
using wire::MessageType;
using wire::Result;
using wire::State;

namespace {

bool is_open;  // a HELLO with the right version came: the sequence is defined
uint8_t expected_seq;
Result refusal;
uint8_t refusal_seq;
uint8_t crc_errors;
uint32_t host_nonce;
bool welcome_due;
bool status_due;

bool reading_segments;  // a SEGMENTS frame is being carried out
Reader segments;        // what is left of it

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

Result enable(Reader fields, uint32_t now_ticks) {
    const uint8_t on = fields.u8();
    if (!fields.ok() || !fields.at_end()) return Result::MALFORMED;
    if (on > 1) return Result::OUT_OF_RANGE;
    const Command command = on == 1 ? Command::ENABLE : Command::RELEASE;
    if (!supervisor::allows(command)) return Result::WRONG_STATE;
    supervisor::apply(command, now_ticks);
    return Result::OK;
}

Result start(Reader fields, uint32_t now_ticks) {
    const uint32_t lead_ticks = fields.u32();
    if (!fields.ok() || !fields.at_end()) return Result::MALFORMED;
    if (lead_ticks < wire::MIN_LEAD_TICKS || lead_ticks > wire::MAX_SEGMENT_TICKS)
        return Result::OUT_OF_RANGE;
    if (!supervisor::allows(Command::START) || motion::is_empty()) return Result::WRONG_STATE;
    supervisor::apply(Command::START, now_ticks);
    motion::start(now_ticks + lead_ticks);
    return Result::OK;
}

Result clear(Reader fields, uint32_t now_ticks) {
    if (!fields.at_end()) return Result::MALFORMED;
    if (!supervisor::allows(Command::CLEAR)) return Result::WRONG_STATE;
    supervisor::apply(Command::CLEAR, now_ticks);
    refusal = Result::OK;
    refusal_seq = 0;
    return Result::OK;
}

// Stages the next segment of the frame, or commits all after the last. True when the frame is done, with its
// result.
bool next_segment(Result& result, uint32_t now_ticks) {
    if (!supervisor::allows(Command::SEGMENTS)) {
        result = Result::WRONG_STATE;
        return true;
    }
    if (motion::is_complete()) {
        result = Result::WRONG_STATE;
        supervisor::fail(Fault::QUEUE_MISUSE, now_ticks);
        return true;
    }
    result = motion::stage(segments);
    if (result == Result::BUSY) {
        motion::discard();
        return true;
    }
    if (result != Result::OK) {  // a motion with a segment left out must not go on
        supervisor::fail(Fault::BAD_SEGMENT, now_ticks);
        return true;
    }
    if (!segments.at_end()) return false;
    if (!motion::commit()) result = Result::WRONG_STATE;
    return true;
}

void execute(const Frame& frame, uint32_t now_ticks) {
    const Reader fields(frame.payload, frame.length);
    switch (static_cast<MessageType>(frame.type)) {
        case MessageType::QUERY:
            return finish(fields.at_end() ? Result::OK : Result::MALFORMED);
        case MessageType::ENABLE:
            return finish(enable(fields, now_ticks));
        case MessageType::START:
            return finish(start(fields, now_ticks));
        case MessageType::CLEAR:
            return finish(clear(fields, now_ticks));
        case MessageType::SEGMENTS:
            segments = fields;
            reading_segments = true;
            return;
        default:
            return finish(Result::UNKNOWN_TYPE);
    }
}

}  // namespace

void reset() {
    is_open = false;
    expected_seq = 0;
    refusal = Result::OK;
    refusal_seq = 0;
    crc_errors = 0;
    welcome_due = status_due = reading_segments = false;
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

bool is_busy() { return reading_segments; }

void advance(uint32_t now_ticks) {
    Result result;
    if (!next_segment(result, now_ticks)) return;
    reading_segments = false;
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
