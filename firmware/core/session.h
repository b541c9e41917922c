// The session with the host: sequence, dispatch of messages, refusals, and which reply is due.
#pragma once

#include <stdint.h>

#include "frame_receiver.h"

namespace planarm {
namespace session {

// What STATUS tells of the session.
struct Report {
    uint8_t expected_seq;  // the next frame's, told in every reply
    wire::Result refusal;
    uint8_t refusal_seq;
    uint8_t crc_errors;
};

// No session. For start-up.
void reset();

// A frame that passed its checks. Its payload must stay in place until `is_busy` is false.
void on_frame(const Frame& frame, uint32_t now_ticks);
// A frame that failed its checks.
void on_damage();

// True while a frame is being carried out piece by piece.
bool is_busy();
// Carries out the next piece, one segment.
void advance(uint32_t now_ticks);

// Asks for a STATUS that no frame asked for.
void announce();

Report report();

// Builds the reply that is due and returns its encoded size; 0 when none is due. It tells this very moment.
uint8_t take_reply(uint8_t* encoded);

}  // namespace session
}  // namespace planarm
