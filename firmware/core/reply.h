// Builds the device's frames.
#pragma once

#include <stdint.h>

#include "session.h"

namespace planarm {
namespace reply {

// What WELCOME tells of the last start.
struct Boot {
    uint32_t nonce;  // differs after every reset
    wire::Reset cause;
    bool interrupted;
};

// For start-up.
void set_boot(const Boot& boot);

// Begin to send a frame; hal::serial_can_send must hold.
void send_welcome(const session::Report& report, uint32_t host_nonce);
void send_status(const session::Report& report);

}  // namespace reply
}  // namespace planarm
