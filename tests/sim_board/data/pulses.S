; OC1A (D9) toggles every 800 cycles, OC1B (D10) too: Timer1 in CTC mode, no prescaler (ATmega328P datasheet,
; 16.9.2). D13 follows D2. Needs no serial line.
#include "uno.inc"
.global main
main:
    ldi r16, (1 << DDB1) | (1 << DDB2) | (1 << DDB5)
    out DDRB, r16
    ldi r16, hi8(799)
    sts OCR1AH, r16
    ldi r16, lo8(799)
    sts OCR1AL, r16
    ldi r16, (1 << COM1A0) | (1 << COM1B0)
    sts TCCR1A, r16
    ldi r16, (1 << WGM12) | (1 << CS10)
    sts TCCR1B, r16
follow:
    sbic PIND, 2
    sbi PORTB, 5
    sbis PIND, 2
    cbi PORTB, 5
    rjmp follow
