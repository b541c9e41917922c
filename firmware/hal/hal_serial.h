// The serial line at the wire's baud rate, 8N1: a receive ring, and one reply at a time.
#pragma once

#include <stdint.h>

namespace hal {

// Switches the USART on. Interrupts are still off.
void serial_init();

// The oldest received bytes, as many as lie together; returns how many. They stay until they are dropped.
uint8_t serial_peek(const uint8_t*& bytes);
void serial_drop(uint8_t count);

// True when no reply is being sent.
bool serial_can_send();

// Sends `size` bytes (at least one), which must stay in place meanwhile.
void serial_send(const uint8_t* bytes, uint8_t size);

// Bytes lost in the USART, and bytes lost because the ring was full; both modulo 256.
uint8_t serial_overruns();
uint8_t serial_ring_full();

}  // namespace hal
