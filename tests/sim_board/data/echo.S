; Sends every byte back plus one, by polling. 250,000 baud. A byte 0x00 stops the program with BREAK,
; 0x01 by an undefined opcode, 0x02 by sleeping with interrupts off. At its start it sends 'R' and MCUSR.
#include "uno.inc"
.global main
main:
    in r20, MCUSR
    ldi r16, 0
    out MCUSR, r16
    usart_on 7
    ldi r16, 'R'
    sts UDR0, r16
    mov r18, r20
    rjmp send
receive:
    lds r17, UCSR0A
    sbrs r17, RXC0
    rjmp receive
    lds r18, UDR0
    cpi r18, 0
    breq stop_break
    cpi r18, 1
    breq stop_opcode
    cpi r18, 2
    breq stop_asleep
    inc r18
send:
    lds r17, UCSR0A
    sbrs r17, UDRE0
    rjmp send
    sts UDR0, r18
    rjmp receive
stop_break:
    break
stop_opcode:
    .word 0xFFFF
stop_asleep:
    cli
    ldi r16, (1 << SM1) | (1 << SE)
    out SMCR, r16
    sleep
    rjmp receive
