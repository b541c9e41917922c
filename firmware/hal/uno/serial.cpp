#include <avr/interrupt.h>
#include <avr/io.h>

#include "framing.h"
#include "hal_serial.h"
#include "hal_signals.h"
#include "hal_step_timer.h"
#include "messages.h"

namespace hal {

namespace {

using planarm::wire::BAUD;
using planarm::wire::RX_RING_BYTES;
using planarm::wire::TICKS_HZ;

constexpr uint32_t BAUD_DIVIDER = TICKS_HZ / (8 * BAUD);  // double speed, ATmega328P datasheet, 19.3
static_assert(BAUD_DIVIDER * 8 * BAUD == TICKS_HZ, "the baud rate must be exact");
static_assert((RX_RING_BYTES & (RX_RING_BYTES - 1)) == 0, "ring indices wrap by a mask");

// Written by the interrupt. At a multiple of 256 (image.ld), so that an index is the address's low byte.
alignas(RX_RING_BYTES) uint8_t ring[RX_RING_BYTES];

// The place of the byte received last, that of the first which finds no room (RX_RING_BYTES behind the one to
// be taken next), and the emergency bytes in a row, counted from the high byte of the ring's address, all
// modulo 256, where IN and OUT reach them: of timer 0 only the overflow is used. A boot loader may have left
// anything there.
#define RING_HEAD GPIOR2
#define RING_LIMIT OCR0A
#define EMERGENCY_RUN OCR0B

volatile uint8_t ring_full;
volatile uint8_t overruns;  // bytes lost in the USART

volatile uint8_t holds;

constexpr uint8_t TOLD = 0x04;

// Timer 0 counts from here to its overflow once an emergency has disarmed the joints. A pulse that rose just
// before is then at least as long as drivers need: it falls 12 cycles or more after END_TICKS.
constexpr uint16_t END_TICKS = planarm::wire::MIN_STEP_HIGH_TICKS - 12;
static_assert(END_TICKS < 256, "timer 0 has 8 bits");
constexpr uint16_t END_COUNT = 256 - END_TICKS;

volatile uint8_t sending_at;  // 256 less the bytes left to be sent, 0 at the end

}  // namespace

uint8_t reply[MAX_REPLY_BYTES];
volatile uint8_t emergency_state;

void serial_init() {
    TCCR0B = 0;
    RING_HEAD = static_cast<uint8_t>(-1);
    RING_LIMIT = RX_RING_BYTES;
    EMERGENCY_RUN = static_cast<uint8_t>(reinterpret_cast<uintptr_t>(ring) >> 8);
    TCNT0 = END_COUNT;
    TIMSK0 = _BV(TOIE0);
    UBRR0 = BAUD_DIVIDER - 1;
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
}

// The ring's bytes are not volatile: those behind the head are the interrupt's, the others are not written.
SerialBytes serial_peek() {
    const uint8_t limit = RING_LIMIT;
    const uint8_t count = static_cast<uint8_t>(RING_HEAD - limit + (RX_RING_BYTES + 1));
    compiler_barrier();
    const uint8_t at = limit & (RX_RING_BYTES - 1);
    const uint8_t together = static_cast<uint8_t>(RX_RING_BYTES - at);
    return {ring + at, count < together ? count : together};
}

void serial_drop(uint8_t count) {
    compiler_barrier();
    RING_LIMIT = static_cast<uint8_t>(RING_LIMIT + count);
}

bool serial_can_send() { return sending_at == 0; }

// The reply's bytes are not volatile either: they are written before the interrupt may look at them.
void serial_send(uint8_t size) {
    compiler_barrier();
    sending_at = static_cast<uint8_t>(0 - size);
    UCSR0B = _BV(RXCIE0) | _BV(UDRIE0) | _BV(RXEN0) | _BV(TXEN0);
}

uint8_t serial_overruns() { return overruns; }

uint8_t serial_ring_full() { return ring_full; }

uint8_t hold_count() { return holds; }

Emergency emergency() { return static_cast<Emergency>(emergency_state & EMERGENCY_CAUSE); }

void emergency_told() {
    const InterruptLock lock;
    emergency_state |= TOLD;
}

void emergency_clear() {
    const InterruptLock lock;
    if ((emergency_state & TOLD) != 0) emergency_state = 0;
}

}  // namespace hal

namespace {

// Step pins of joints 2 and 3, where there are any.
template <uint8_t JOINT>
constexpr uint8_t scheduled_pin() {
    return planarm::wire::STEP_PINS[JOINT % planarm::wire::JOINTS];
}
template <uint8_t JOINT>
constexpr uint8_t scheduled_port() {
    return static_cast<uint8_t>(hal::port_of(scheduled_pin<JOINT>()));
}

}  // namespace

static_assert(_SFR_MEM_ADDR(TIMSK2) == _SFR_MEM_ADDR(TIMSK1) + 1, "%[timsk] + 1");
static_assert(static_cast<uint8_t>(hal::Emergency::LINE) == 1 && hal::ONLY_LAPS == 1 && _BV(CS00) == 1,
              "what r30 is at the last emergency byte");

// The interrupts, in assembler with registers that no other code uses: see step_interrupts.cpp.

// Cycles with entry and jump: 36 for a byte stored, 39 for one that finds no room, 42 and 43 of the same
// after an overrun, 35 for a hold, 33 for an emergency byte that is not the last and 40 for the last, with
// four joints 43. A byte comes every 640 at the fastest. Bytes lost before a hold or an emergency byte are
// not counted. From the 31st cycle of the last emergency byte on no pin rises; those that are high timer 0's
// interrupt takes low, once they have been so for the least high time.
ISR(USART_RX_vect, ISR_NAKED) {
    __asm__ __volatile__(
        R"(
        in   r2, %[sreg]
        movw r4, r30
        lds  r3, %[status]              ; before the byte, which moves it on
        lds  r30, %[data]
        mov  r6, r30
        subi r30, %[special]
        cpi  r30, 2
        brlo 4f
        in   r30, %[head]
        in   r31, %[limit]
        inc  r30
        cp   r30, r31
        breq 2f
        out  %[head], r30
        andi r30, %[size] - 1
        ldi  r31, hi8(%[ring])
        out  %[run], r31
        st   Z, r6
        sbrc r3, %[overrun]
        rjmp 3f
    9:  movw r30, r4
        out  %[sreg], r2
        reti

    2:  ldi  r31, hi8(%[ring])          ; no room
        out  %[run], r31
        lds  r30, %[full]
        inc  r30
        sts  %[full], r30
        sbrs r3, %[overrun]
        rjmp 9b
    3:  lds  r30, %[overruns]
        inc  r30
        sts  %[overruns], r30
        movw r30, r4
        out  %[sreg], r2
        reti

    4:  sbrc r30, 0                     ; out of band
        rjmp 6f
        ldi  r31, hi8(%[ring])          ; hold
        out  %[run], r31
        lds  r30, %[holds]
        inc  r30
        sts  %[holds], r30
        rjmp 9b

    6:  in   r31, %[run]                ; emergency
        inc  r31
        out  %[run], r31
        cpi  r31, hi8(%[ring] + %[repeats] * 256)
        brlo 9b
        sts  %[state], r30
    .Lend_pulses:                       ; with 1 in r30; the stop input's interrupt comes here, too
        .if %[all_disarmed]
        ldi  r31, %[all_disarmed]
        sts  %[tccra], r31
        .endif
        .if %[all_disarmed] || %[joints] > 2
        out  %[tccr0b], r30             ; timer 0 starts
        .endif
        sts  %[timsk], r30
        .if %[joints] > 2
        ldi  r31, 0
        sts  %[timsk] + 1, r31
        .endif
        movw r30, r4
        out  %[sreg], r2
        reti
        )" ::[sreg] "I"(_SFR_IO_ADDR(SREG)),
        [status] "i"(&UCSR0A), [data] "i"(&UDR0), [overrun] "i"(DOR0), [special] "M"(planarm::FIRST_SPECIAL),
        [head] "I"(_SFR_IO_ADDR(RING_HEAD)), [limit] "I"(_SFR_IO_ADDR(RING_LIMIT)),
        [run] "I"(_SFR_IO_ADDR(EMERGENCY_RUN)), [ring] "i"(hal::ring), [size] "i"(hal::RX_RING_BYTES),
        [full] "i"(&hal::ring_full), [overruns] "i"(&hal::overruns), [holds] "i"(&hal::holds),
        [repeats] "M"(planarm::wire::EMERGENCY_REPEATS), [all_disarmed] "i"(hal::ALL_DISARMED),
        [tccra] "i"(&TCCR1A), [tccr0b] "I"(_SFR_IO_ADDR(TCCR0B)), [timsk] "i"(&TIMSK1),
        [state] "i"(&hal::emergency_state), [joints] "n"(planarm::wire::JOINTS));
}

// The stop input's contact opened: what the last emergency byte does, in 29 cycles, with four joints 32; 12
// when it closes.
ISR(PCINT1_vect, ISR_NAKED) {
    __asm__ __volatile__(
        R"(
        sbis %[pins], %[stop]
        reti
        in   r2, %[sreg]
        movw r4, r30
        ldi  r30, %[input]
        sts  %[state], r30
        ldi  r30, 1
        jmp  .Lend_pulses
        )" ::[sreg] "I"(_SFR_IO_ADDR(SREG)),
        [pins] "I"(_SFR_IO_ADDR(PINC)), [stop] "I"(hal::bit_of(planarm::wire::STOP_PIN)),
        [input] "M"(static_cast<uint8_t>(hal::Emergency::INPUT)), [state] "i"(&hal::emergency_state));
}

// Ends the pulses that an emergency has found high, in 20 cycles, with four joints 24.
ISR(TIMER0_OVF_vect, ISR_NAKED) {
    __asm__ __volatile__(
        R"(
        mov  r4, r30
        ldi  r30, %[all_forced]
        sts  %[tccrc], r30
        .if %[joints] > 2
        cbi  %[port2], %[bit2]
        cbi  %[port3], %[bit3]
        .endif
        ldi  r30, 0
        out  %[tccr0b], r30
        ldi  r30, %[count]
        out  %[tcnt0], r30
        mov  r30, r4
        reti
        )" ::[all_forced] "M"(_BV(FOC1A) | _BV(FOC1B)),
        [tccrc] "i"(&TCCR1C), [tccr0b] "I"(_SFR_IO_ADDR(TCCR0B)), [count] "M"(hal::END_COUNT),
        [tcnt0] "I"(_SFR_IO_ADDR(TCNT0)), [joints] "n"(planarm::wire::JOINTS),
        [port2] "I"(scheduled_port<2>()), [bit2] "I"(hal::bit_of(scheduled_pin<2>())),
        [port3] "I"(scheduled_port<3>()), [bit3] "I"(hal::bit_of(scheduled_pin<3>())));
}

// Cycles with entry and jump: 34 for a byte, 39 for one that must be escaped, 35 for the delimiter; once
// every 640. For a byte that must be escaped ESCAPE goes out and the byte is changed in its place, so that
// next time it goes out like any other.
ISR(USART_UDRE_vect, ISR_NAKED) {
    __asm__ __volatile__(
        R"(
        in   r2, %[sreg]
        movw r4, r30
        lds  r30, %[at]
        mov  r3, r30
        ldi  r31, 0
        subi r30, lo8(-(%[before]))
        sbci r31, hi8(-(%[before]))
        ld   r6, Z
        inc  r3
        breq 2f
        mov  r7, r31
        mov  r31, r6
        subi r31, %[special]
        cpi  r31, 4
        brlo 3f
    1:  sts  %[data], r6
        sts  %[at], r3
        movw r30, r4
        out  %[sreg], r2
        reti

    2:  ldi  r30, %[only_receive]       ; the delimiter
        sts  %[control], r30
        rjmp 1b

    3:  subi r31, lo8(-(%[escaped]))    ; what is to be escaped
        mov  r6, r31
        mov  r31, r7
        st   Z, r6
        ldi  r30, %[escape]
        sts  %[data], r30
        movw r30, r4
        out  %[sreg], r2
        reti
        )" ::[sreg] "I"(_SFR_IO_ADDR(SREG)),
        [at] "i"(&hal::sending_at), [before] "i"(hal::reply + hal::MAX_REPLY_BYTES - 256), [data] "i"(&UDR0),
        [control] "i"(&UCSR0B), [only_receive] "i"(_BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0)),
        [special] "M"(planarm::FIRST_SPECIAL), [escape] "M"(planarm::wire::ESCAPE),
        [escaped] "M"(planarm::FIRST_SPECIAL ^ planarm::wire::ESCAPE_XOR));
}
