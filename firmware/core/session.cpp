#include "session.h"

#include "commands.h"
#include "hal_base.h"
#include "intake.h"
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

struct Session {
    bool is_open;  // a HELLO with the right version came: the sequence is defined
    bool welcome_due;
    bool status_due;
    Report report;
    uint32_t host_nonce;
    const Frame* checking;  // a SEGMENTS frame that is being carried out, segment by segment
};

Session session;

Session& current() { return hal::by_base(session); }

[[gnu::noinline]] void note_refusal(Result result, uint8_t seq) {
    Report& report = current().report;
    if (static_cast<int8_t>(result) >= 0 || report.refusal != Result::OK) return;
    report.refusal = result;
    report.refusal_seq = seq;
}

void forget_refusal(Session& at) {
    at.report.refusal = Result::OK;
    at.report.refusal_seq = 0;
}

// Ends the frame that was expected: it counts as carried out unless it is to be sent again.
void finish(Result result) {
    Session& at = current();
    at.status_due = true;
    if (result == Result::BUSY) return;
    note_refusal(result, at.report.expected_seq);
    ++at.report.expected_seq;
}

void hello(const Frame& frame) {
    Session& at = current();
    if (frame.length != sizeof(wire::Hello)) {
        note_refusal(Result::MALFORMED, frame.seq);
        at.status_due = true;
        return;
    }
    const wire::Hello& told = frame.as<wire::Hello>();
    at.host_nonce = told.host_nonce;
    at.report.expected_seq = static_cast<uint8_t>(frame.seq + 1);
    forget_refusal(at);
    at.is_open = told.protocol_version == wire::PROTOCOL_VERSION;
    if (!at.is_open) note_refusal(Result::VERSION, frame.seq);
    at.welcome_due = true;
}

// A motion with a segment left out must not go on.
[[gnu::noinline]] Result refuse(Result result) {
    supervisor::fail(result == Result::WRONG_STATE ? Fault::QUEUE_MISUSE : Fault::BAD_SEGMENT);
    return result;
}

// Checks the next segment of the frame, or queues all after the last. True when the frame is done, with its
// result.
bool next_segment(Result& result) {
    result = Result::WRONG_STATE;
    if (!supervisor::allows(Event::SEGMENTS)) return true;
    result = intake::check_next();
    if (result != Result::OK) {
        refuse(result);
        return true;
    }
    const uint8_t joint_out = intake::joint_out_of_limits();
    if (joint_out != wire::JOINTS) {
        supervisor::fail(Fault::SOFT_LIMIT, joint_out);
        result = Result::OUT_OF_RANGE;
        return true;
    }
    if (!intake::is_checked()) return false;
    if (motion::is_too_late()) {
        result = Result::WRONG_STATE;
    } else {
        const Frame& frame = *current().checking;
        intake::commit(frame.payload, frame.length);
    }
    return true;
}

// Begins with a SEGMENTS frame: what can be told of it as a whole.
void begin_segments(const Frame& frame) {
    if (!supervisor::allows(Event::SEGMENTS)) return finish(Result::WRONG_STATE);
    const Result result = intake::begin_check(frame.payload, frame.length);
    if (result == Result::BUSY) return finish(result);
    if (result != Result::OK) return finish(refuse(result));
    current().checking = &frame;
}

void execute(const Frame& frame) {
    if (static_cast<MessageType>(frame.type) == MessageType::SEGMENTS) return begin_segments(frame);
    const Result result = commands::execute(frame);
    if (result == Result::OK && static_cast<MessageType>(frame.type) == MessageType::CLEAR) {
        forget_refusal(current());
    }
    finish(result);
}

}  // namespace

void reset() { hal::clear_at_start(session); }

void on_frame(const Frame& frame) {
    Session& at = current();
    if (static_cast<MessageType>(frame.type) == MessageType::HELLO) {
        hello(frame);
    } else if (at.is_open && frame.seq == at.report.expected_seq) {
        execute(frame);
    } else {
        at.status_due = true;
    }
}

void on_damage() {
    Session& at = current();
    ++at.report.crc_errors;
    at.status_due = true;
}

bool is_busy() { return session.checking != nullptr; }

void advance() {
    Result result;
    if (!next_segment(result)) return;
    session.checking = nullptr;
    finish(result);
}

void announce() { session.status_due = true; }

bool send_reply() {
    Session& at = current();
    if (!at.welcome_due && !at.status_due) return false;
    if (at.welcome_due) {
        at.welcome_due = false;
        reply::send_welcome(at.report, at.host_nonce);
    } else {
        at.status_due = false;
        reply::send_status(at.report);
    }
    return true;
}

}  // namespace session
}  // namespace planarm
