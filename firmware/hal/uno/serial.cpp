#include <avr/interrupt.h>
#include <avr/io.h>

#include "hal_serial.h"
#include "messages.h"

namespace hal {

namespace {

using planarm::wire::BAUD;
using planarm::wire::RX_RING_BYTES;
using planarm::wire::TICKS_HZ;

constexpr uint32_t BAUD_DIVIDER = TICKS_HZ / (8 * BAUD);  // double speed, ATmega328P datasheet, 19.3
static_assert(BAUD_DIVIDER * 8 * BAUD == TICKS_HZ, "the baud rate must be exact");
static_assert((RX_RING_BYTES & (RX_RING_BYTES - 1)) == 0, "ring indices wrap by a mask");

uint8_t ring[RX_RING_BYTES];
volatile uint8_t ring_head;  // received bytes, modulo 256; written by the interrupt
volatile uint8_t ring_tail;  // bytes taken, modulo 256; written by the main program
volatile uint8_t overruns;
volatile uint8_t ring_full;

const uint8_t* volatile sending;
volatile uint8_t sending_left;

}  // namespace

void serial_init() {
    UBRR0 = BAUD_DIVIDER - 1;
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
}

bool serial_read(uint8_t& byte) {
    const uint8_t tail = ring_tail;
    if (tail == ring_head) return false;
    byte = ring[tail & (RX_RING_BYTES - 1)];
    ring_tail = static_cast<uint8_t>(tail + 1);
    return true;
}

bool serial_can_send() { return sending_left == 0; }

void serial_send(const uint8_t* bytes, uint8_t size) {
    sending = bytes;
    sending_left = size;
    UCSR0B = _BV(RXCIE0) | _BV(UDRIE0) | _BV(RXEN0) | _BV(TXEN0);
}

uint8_t serial_overruns() { return overruns; }

uint8_t serial_ring_full() { return ring_full; }

}  // namespace hal

// 75 cycles with entry and jump; a byte comes every 640 at the fastest.
ISR(USART_RX_vect) {
    using namespace hal;
    const uint8_t status = UCSR0A;  // before UDR0, which moves it on
    const uint8_t byte = UDR0;
    if (status & _BV(DOR0)) overruns = static_cast<uint8_t>(overruns + 1);
    const uint8_t head = ring_head;
    if (static_cast<uint8_t>(head - ring_tail) == RX_RING_BYTES) {
        ring_full = static_cast<uint8_t>(ring_full + 1);
        return;
    }
    ring[head & (RX_RING_BYTES - 1)] = byte;
    ring_head = static_cast<uint8_t>(head + 1);
}

// 58 cycles with entry and jump, 60 after the last byte; once every 640.
ISR(USART_UDRE_vect) {
    using namespace hal;
    const uint8_t* const at = sending;
    UDR0 = *at;
    sending = at + 1;
    const uint8_t left = static_cast<uint8_t>(sending_left - 1);
    sending_left = left;
    if (left == 0) UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
}
