// Builds the device's frames.
#pragma once

#include <stdint.h>

#include "session.h"

namespace planarm {
namespace reply {

// What WELCOME tells of the last start, for start-up: a nonce that differs after every reset, its cause, and
// whether the drivers were enabled then.
void set_boot(uint32_t nonce, wire::Reset cause, bool interrupted);

// Begin to send a frame; hal::serial_can_send must hold.
void send_welcome(const session::Report& report, uint32_t host_nonce);
void send_status(const session::Report& report);

}  // namespace reply
}  // namespace planarm
