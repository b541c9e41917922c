#include "firmware.h"

#include "clock.h"
#include "frame_receiver.h"
#include "hal_serial.h"
#include "motion.h"
#include "reply.h"
#include "session.h"
#include "supervisor.h"

namespace planarm {
namespace firmware {

namespace {

// Bytes decoded in one pass, so that the motion is looked after often.
constexpr uint8_t BYTES_A_PASS = 8;

FrameReceiver receiver;
uint8_t reply_bytes[reply::MAX_ENCODED];

// Spreads counts that follow each other over all 32 bits; every step can be undone, so different counts stay
// different. The multiplier is 2^32 over the golden ratio, made odd.
uint32_t mix(uint32_t count) {
    uint32_t mixed = (count + 1) * 0x9E3779B1u;
    mixed ^= mixed >> 15;
    mixed *= 0x9E3779B1u;
    return mixed ^ (mixed >> 13);
}

void serve_motion(uint32_t now_ticks) {
    switch (motion::serve(now_ticks)) {
        case motion::Progress::GOING:
            return;
        case motion::Progress::DONE:
            supervisor::motion_done();
            break;
        case motion::Progress::MISSED:
            supervisor::fail(wire::Fault::MISSED_DEADLINE, now_ticks);
            break;
        case motion::Progress::UNDERRUN:
            supervisor::fail(wire::Fault::UNDERRUN, now_ticks);
            break;
    }
    session::announce();
}

void receive(uint32_t now_ticks) {
    uint8_t byte;
    for (uint8_t i = 0; i < BYTES_A_PASS && hal::serial_read(byte); ++i) {
        const FrameReceiver::Event event = receiver.receive(byte);
        if (event == FrameReceiver::Event::DAMAGED) session::on_damage();
        if (event == FrameReceiver::Event::FRAME) return session::on_frame(receiver.frame(), now_ticks);
    }
}

// Sends the reply that is due. True when there was one.
bool reply() {
    if (!hal::serial_can_send()) return false;
    const uint8_t size = session::take_reply(reply_bytes);
    if (size != 0) hal::serial_send(reply_bytes, size);
    return size != 0;
}

}  // namespace

void set_up(uint32_t boot_count, uint32_t now_ticks) {
    receiver = FrameReceiver();
    clock::reset(now_ticks);
    motion::reset();
    supervisor::reset();
    session::reset();
    reply::set_boot_nonce(mix(boot_count));
}

void pass() {
    const uint32_t now_ticks = clock::now();
    serve_motion(now_ticks);
    if (reply()) return;
    if (session::is_busy()) {
        session::advance(now_ticks);
    } else {
        receive(now_ticks);
    }
}

}  // namespace firmware
}  // namespace planarm
