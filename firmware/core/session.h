// The session with the host: sequence, dispatch of messages, refusals, and which reply is due.
#pragma once

#include <stdint.h>

#include "frame_receiver.h"

namespace planarm {
namespace session {

// What replies tell of the session.
struct Report {
    uint8_t expected_seq;  // the next frame's
    wire::Result refusal;
    uint8_t refusal_seq;
    uint8_t crc_errors;
};

// No session. For start-up.
void reset();

// A frame that passed its checks. Its payload must stay in place until `is_busy` is false.
void on_frame(const Frame& frame);
// A frame that failed its checks.
void on_damage();

// True while a frame is being carried out piece by piece.
bool is_busy();
// Carries out the next piece, one segment.
void advance();

// Asks for a STATUS that no frame asked for.
void announce();

// Sends the reply that is due, which tells this very moment; hal::serial_can_send must hold. True when there
// was one.
bool send_reply();

}  // namespace session
}  // namespace planarm
