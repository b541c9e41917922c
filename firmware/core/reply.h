// Builds the device's frames, encoded for the line.
#pragma once

#include <stdint.h>

#include "session.h"

namespace planarm {
namespace reply {

// WELCOME is as large as STATUS or larger; every byte but the delimiter may be stuffed.
constexpr uint8_t MAX_PAYLOAD = wire::WELCOME_BYTES;
constexpr uint8_t MAX_ENCODED = 2 * (wire::HEADER_BYTES + MAX_PAYLOAD + 2 * wire::CRC_BYTES) + 1;

// What WELCOME tells of the last start.
struct Boot {
    uint32_t nonce;  // differs after every reset
    wire::Reset cause;
    bool interrupted;
};

// For start-up.
void set_boot(const Boot& boot);

// Both write at most MAX_ENCODED bytes and return how many.
uint8_t welcome(uint8_t* encoded, const session::Report& report, uint32_t host_nonce);
uint8_t status(uint8_t* encoded, const session::Report& report);

}  // namespace reply
}  // namespace planarm
