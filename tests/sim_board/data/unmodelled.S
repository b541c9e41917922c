; Touches parts that a stepper firmware does not need: the two-wire interface and the analogue comparator.
#include "uno.inc"
.global main
main:
    ldi r16, 72
    sts TWBR, r16
    in r17, ACSR
loop:
    rjmp loop
