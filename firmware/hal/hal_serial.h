// The serial line at the wire's baud rate, 8N1: a receive ring, and one reply at a time.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace hal {

namespace wire = planarm::wire;

// Switches the USART on. Interrupts are still off.
void serial_init();

struct SerialBytes {
    const uint8_t* at;
    uint8_t count;
};

// The oldest received bytes, as many as lie together. They stay until they are dropped.
SerialBytes serial_peek();
void serial_drop(uint8_t count);

// True when no reply is being sent.
bool serial_can_send();

// The reply being sent, unstuffed: it ends with this buffer.
constexpr uint8_t MAX_REPLY_BYTES = wire::HEADER_BYTES + 2 * wire::CRC_BYTES + wire::WELCOME_BYTES + 1;
static_assert(wire::WELCOME_BYTES >= wire::STATUS_BYTES, "the longest reply");
extern uint8_t reply[MAX_REPLY_BYTES];

// Sends the last `size` bytes of it, all but the last of them stuffed on the way.
void serial_send(uint8_t size);

// Bytes lost in the USART, and bytes lost because the ring was full; both modulo 256.
uint8_t serial_overruns();
uint8_t serial_ring_full();

}  // namespace hal
