// Builds the device's frames, encoded for the line.
#pragma once

#include <stdint.h>

#include "session.h"

namespace planarm {
namespace reply {

// WELCOME is the larger of the two; every byte but the delimiter may be stuffed.
constexpr uint8_t MAX_PAYLOAD = wire::WELCOME_BYTES;
constexpr uint8_t MAX_ENCODED = 2 * (wire::HEADER_BYTES + MAX_PAYLOAD + 2 * wire::CRC_BYTES) + 1;

// Told to the host so that it sees every reset. For start-up.
void set_boot_nonce(uint32_t nonce);

// Both write at most MAX_ENCODED bytes and return how many.
uint8_t welcome(uint8_t* encoded, const session::Report& report, uint32_t host_nonce);
uint8_t status(uint8_t* encoded, const session::Report& report);

}  // namespace reply
}  // namespace planarm
