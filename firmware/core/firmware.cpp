#include "firmware.h"

#include "clock.h"
#include "fixed.h"
#include "frame_receiver.h"
#include "hal_journal.h"
#include "hal_pins.h"
#include "hal_serial.h"
#include "hal_signals.h"
#include "home.h"
#include "inputs.h"
#include "motion.h"
#include "power.h"
#include "reply.h"
#include "session.h"
#include "settings.h"
#include "supervisor.h"

namespace planarm {
namespace firmware {

namespace {

// While a motion runs, what is not its business is looked at in one pass of so many; so are its limit
// switches, which do not wait as the line does.
constexpr uint8_t PASSES_A_LOOK = 4;

// Bytes decoded in one pass, so that the motion is looked after often.
constexpr uint8_t BYTES_A_PASS = 16;

FrameReceiver receiver;
uint8_t seen_holds;
uint8_t passes;

// Spreads counts that follow each other over all 32 bits; every step can be undone, so different counts stay
// different. The multiplier, 2^16 over the golden ratio, is odd.
uint32_t mix(uint32_t count) {
    uint32_t mixed = count + 1;
    for (uint8_t turn = 0; turn < 2; ++turn) mixed = multiply_low(mixed, 0x9E37);
    return mixed ^ (mixed >> 16);
}

// Functions of their own: each is called from many places.
[[gnu::noinline]] void tell(supervisor::Event event) {
    supervisor::apply(event);
    session::announce();
}

[[gnu::noinline]] void fail(wire::Fault fault, uint8_t detail = 0) {
    supervisor::fail(fault, detail);
    session::announce();
}

// In place of a fault that keeps the position: an emergency loses it, and may release the drivers.
void serve_emergency() {
    const bool open =
        settings::has_option(settings::STOP_INPUT) && (hal::inputs() & hal::STOP_INPUT_OPEN) != 0;
    const hal::Emergency emergency = hal::emergency();
    if (emergency == hal::Emergency::NONE && !open) return;
    if (supervisor::clear_event() == supervisor::Event::CLEAR_KEPT) {
        fail(emergency == hal::Emergency::LINE ? wire::Fault::EMERGENCY_STOP : wire::Fault::STOP_INPUT);
    }
    if (settings::has_option(settings::EMERGENCY_RELEASES)) power::release();
}

// A step was missed, or the interrupts were switched off by an emergency a moment ago.
void missed(uint8_t joint) {
    if (hal::emergency() != hal::Emergency::NONE) return serve_emergency();
    fail(wire::Fault::MISSED_DEADLINE, joint);
}

// The event that tells how a motion goes on.
constexpr supervisor::Event event_of(motion::Progress progress) {
    return static_cast<supervisor::Event>(static_cast<uint8_t>(supervisor::Event::AT_REST) +
                                          static_cast<uint8_t>(progress) -
                                          static_cast<uint8_t>(motion::Progress::AT_REST));
}
static_assert(event_of(motion::Progress::STARVED) == supervisor::Event::STARVED &&
                  event_of(motion::Progress::FED) == supervisor::Event::FED &&
                  event_of(motion::Progress::DONE) == supervisor::Event::DONE,
              "the same order");

void serve_motion() {
    const motion::Progress progress = motion::serve();
    switch (progress) {
        case motion::Progress::GOING:
            return;
        case motion::Progress::MISSED:
            return missed(0);
        case motion::Progress::UNDERRUN:
            return fail(wire::Fault::UNDERRUN);
        default:
            return tell(event_of(progress));
    }
}

void serve_homing() {
    switch (home::serve()) {
        case home::Progress::NONE:
        case home::Progress::GOING:
            return;
        case home::Progress::DONE:
            return tell(supervisor::Event::DONE);
        case home::Progress::FAILED:
            return fail(wire::Fault::HOMING_FAILED, home::joint());
        case home::Progress::MISSED:
            return missed(home::joint());
    }
}

// Limit switches in motion; while homing they are what is looked for.
void serve_limits() {
    inputs::serve();
    switch (supervisor::state()) {
        case wire::State::RUNNING:
        case wire::State::HOLDING:
        case wire::State::STOPPING:
            if (inputs::hit_joint() != wire::JOINTS) fail(wire::Fault::LIMIT_SWITCH, inputs::hit_joint());
            return;
        case wire::State::READY:
            return inputs::excuse_hit();
        default:
            return;
    }
}

void serve_hold() {
    const uint8_t holds = hal::hold_count();
    if (holds == seen_holds) return;
    seen_holds = holds;
    tell(supervisor::Event::HOLD);
}

void serve_rest() {
    const bool urgent = motion::is_urgent();
    if ((supervisor::state() == wire::State::RUNNING || urgent) && ++passes % PASSES_A_LOOK != 0) return;
    if (!urgent) {
        power::serve();
        serve_homing();
    }
    serve_limits();
    if (supervisor::state() == wire::State::READY && power::is_idle_too_long()) {
        tell(supervisor::Event::RELEASE);
    }
}

void receive() {
    const hal::SerialBytes waiting = hal::serial_peek();
    if (waiting.count == 0) return;
    const uint8_t count = waiting.count < BYTES_A_PASS ? waiting.count : BYTES_A_PASS;
    const FrameReceiver::Received received = receiver.receive(waiting.at, count);
    hal::serial_drop(received.bytes);
    if (received.event == FrameReceiver::Event::DAMAGED) session::on_damage();
    if (received.event == FrameReceiver::Event::FRAME) session::on_frame(receiver.frame());
}

}  // namespace

void set_up(const Boot& boot, uint32_t now_ticks) {
    receiver.reset();
    clock::reset(now_ticks);
    settings::reset();
    motion::reset();
    home::reset();
    power::reset();
    inputs::reset();
    supervisor::reset();
    session::reset();
    seen_holds = hal::hold_count();
    reply::set_boot(mix(boot.count), boot.cause, boot.was_enabled);
}

void pass() {
    hal::watchdog_feed();
    clock::begin_pass();
    serve_emergency();  // before the motion wonders where its interrupts are
    serve_rest();       // soon after the pass has read the clock: switches are debounced by it
    serve_hold();       // before the motion, whose part of a pass may be long
    serve_motion();
    if (motion::is_urgent()) return;
    hal::journal_serve();
    // An emergency that comes just now is told by the next STATUS: this one has neither fault nor the last
    // steps.
    if (hal::serial_can_send() && session::send_reply()) return;
    if (session::is_busy()) {
        session::advance();
    } else {
        receive();
    }
}

}  // namespace firmware
}  // namespace planarm
