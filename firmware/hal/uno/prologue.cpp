// What functions that save many registers begin and end with (-mcall-prologues): they jump here instead of to
// the compiler's library, whose code saves the interrupts' registers first.
//
// A jump into the middle saves what is from there on. The compiler counts from r2, two bytes each; image.ld
// defines the symbols that it names so far before the code below.

__asm__(
    R"(
        .section .text.common_prologue, "ax", @progbits
        ; r27, r26: bytes of the frame; r31, r30: where to go on. r29, r28 become the frame's address.
        .global common_prologue
    common_prologue:
        push r16
        push r17
        push r28
        push r29
        in   r28, 0x3D
        in   r29, 0x3E
        sub  r28, r26
        sbc  r29, r27
        in   r0, 0x3F
        cli
        out  0x3E, r29
        out  0x3F, r0
        out  0x3D, r28
        ijmp

        .section .text.common_epilogue, "ax", @progbits
        ; r29, r28: the frame's end; r30: bytes saved.
        .global common_epilogue
    common_epilogue:
        ldd  r16, Y + 4
        ldd  r17, Y + 3
        ldd  r26, Y + 2
        ldd  r27, Y + 1
        add  r28, r30
        adc  r29, r1
        in   r0, 0x3F
        cli
        out  0x3E, r29
        out  0x3F, r0
        out  0x3D, r28
        movw r28, r26
        ret
        .text
    )");
