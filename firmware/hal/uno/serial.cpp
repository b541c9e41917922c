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

volatile uint8_t ring[RX_RING_BYTES];  // written by the interrupt, like all but ring_tail
volatile uint8_t ring_head;            // received bytes, modulo 256
volatile uint8_t ring_tail;            // bytes taken, modulo 256
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

// The interrupts, in assembler with registers that no other code uses: see step_interrupts.cpp.

// Cycles with entry and jump: 38 for a byte stored, 36 for one that finds no room, 44 after an overrun. A
// byte comes every 640 at the fastest.
ISR(USART_RX_vect, ISR_NAKED) {
    __asm__ __volatile__(
        R"(
        in   r2, %[sreg]
        movw r4, r30
        lds  r3, %[status]              ; before the byte, which moves it on
        lds  r8, %[data]
        lds  r30, %[head]
        lds  r31, %[tail]
        sub  r31, r30
        cpi  r31, lo8(-(%[size]))
        breq 2f
        mov  r9, r30
        inc  r9
        sts  %[head], r9
        andi r30, %[size] - 1
        ldi  r31, 0
        subi r30, lo8(-(%[ring]))
        sbci r31, hi8(-(%[ring]))
        st   Z, r8
    1:  sbrc r3, %[overrun]
        rjmp 3f
        movw r30, r4
        out  %[sreg], r2
        reti

    2:  lds  r30, %[full]
        inc  r30
        sts  %[full], r30
        rjmp 1b

    3:  lds  r30, %[overruns]
        inc  r30
        sts  %[overruns], r30
        movw r30, r4
        out  %[sreg], r2
        reti
        )" ::[sreg] "I"(_SFR_IO_ADDR(SREG)),
        [status] "i"(&UCSR0A), [data] "i"(&UDR0), [overrun] "i"(DOR0), [head] "i"(&hal::ring_head),
        [tail] "i"(&hal::ring_tail), [ring] "i"(hal::ring), [size] "i"(hal::RX_RING_BYTES),
        [full] "i"(&hal::ring_full), [overruns] "i"(&hal::overruns));
}

// 34 cycles with entry and jump, 36 after the last byte; once every 640.
ISR(USART_UDRE_vect, ISR_NAKED) {
    __asm__ __volatile__(
        R"(
        in   r2, %[sreg]
        movw r4, r30
        lds  r30, %[sending]
        lds  r31, %[sending] + 1
        ld   r3, Z+
        sts  %[data], r3
        sts  %[sending], r30
        sts  %[sending] + 1, r31
        lds  r30, %[left]
        subi r30, 1
        sts  %[left], r30
        brne 1f
        ldi  r30, %[only_receive]
        sts  %[control], r30
    1:  movw r30, r4
        out  %[sreg], r2
        reti
        )" ::[sreg] "I"(_SFR_IO_ADDR(SREG)),
        [sending] "i"(&hal::sending), [data] "i"(&UDR0), [left] "i"(&hal::sending_left),
        [control] "i"(&UCSR0B), [only_receive] "i"(_BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0)));
}
