/* Interrupt-heavy firmware for `./dev bench emulator`: two compare interrupts at 20 kHz each, and an echo of every
 * byte on the serial line at 115,200 baud with a CRC-16 over each 32 of them, all by interrupts and ring buffers.
 *
 * With -DBUSY=1 main never waits: between bytes it computes the CRC of the flash, so that nothing can be gained by
 * passing over a waiting loop. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <stdint.h>
#include <util/crc16.h>

enum { PERIOD = 800, RING = 128, BLOCK = 32 };

typedef struct {
    uint8_t bytes[RING];
    volatile uint8_t head, tail;
} ring_t;

static ring_t received, to_send;
static volatile uint16_t ticks_a, ticks_b;

ISR(TIMER1_COMPA_vect) {
    OCR1A += PERIOD;
    PINB = _BV(PB0);
    ticks_a++;
}

ISR(TIMER1_COMPB_vect) {
    OCR1B += PERIOD;
    PINB = _BV(PB3);
    ticks_b++;
}

ISR(USART_RX_vect) {
    const uint8_t byte = UDR0, next = (received.head + 1) & (RING - 1);
    if (next == received.tail) return;
    received.bytes[received.head] = byte;
    received.head = next;
}

ISR(USART_UDRE_vect) {
    if (to_send.head == to_send.tail) {
        UCSR0B &= ~_BV(UDRIE0);
        return;
    }
    UDR0 = to_send.bytes[to_send.tail];
    to_send.tail = (to_send.tail + 1) & (RING - 1);
}

static void send(uint8_t byte) {
    const uint8_t next = (to_send.head + 1) & (RING - 1);
    while (next == to_send.tail) {
    }
    to_send.bytes[to_send.head] = byte;
    to_send.head = next;
    UCSR0B |= _BV(UDRIE0);
}

int main(void) {
    DDRB = _BV(PB0) | _BV(PB3);
    TCCR1B = _BV(CS10);
    OCR1A = 400;
    OCR1B = 800;
    TIMSK1 = _BV(OCIE1A) | _BV(OCIE1B);
    UCSR0A = _BV(U2X0);
    UBRR0 = 16;
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
    sei();
    uint16_t crc = 0xFFFF, of_flash = 0xFFFF;
    uint8_t in_block = 0;
    const uint8_t *place = 0;
    for (;;) {
        if (received.head != received.tail) {
            const uint8_t byte = received.bytes[received.tail];
            received.tail = (received.tail + 1) & (RING - 1);
            crc = _crc_ccitt_update(crc, byte);
            send(byte);
            if (++in_block == BLOCK) {
                send(crc & 0xFF);
                send(crc >> 8);
                crc = 0xFFFF;
                in_block = 0;
            }
        } else if (BUSY) {
            of_flash = _crc_ccitt_update(of_flash, pgm_read_byte(place++));
            GPIOR1 = of_flash & 0xFF;
        }
    }
}
