#include "reset_cause.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "hal_signals.h"

// Written by early_pins (main.cpp) before memory is set up.
__attribute__((section(".noinit"))) uint8_t reset_flags;

namespace hal {

namespace {

using planarm::wire::Reset;

// Memory holds these after a start of this firmware, and by chance only after power-on. They differ in the
// first byte.
constexpr uint32_t RUNNING = 0x706C616E;
constexpr uint32_t STOOD_STILL = 0x706C6121;
static_assert((RUNNING ^ STOOD_STILL) <= 0xFF, "the interrupt writes one byte");

__attribute__((section(".noinit"))) uint32_t trace;

}  // namespace

Reset find_reset_cause() {
    const uint32_t left = trace;
    trace = RUNNING;
    if ((reset_flags & _BV(PORF)) != 0) return Reset::POWER_ON;
    if ((reset_flags & _BV(BORF)) != 0) return Reset::BROWN_OUT;
    if (left == STOOD_STILL || (reset_flags & _BV(WDRF)) != 0) return Reset::WATCHDOG;
    if ((reset_flags & _BV(EXTRF)) != 0) return Reset::EXTERNAL;
    return left == RUNNING ? Reset::UNKNOWN : Reset::POWER_ON;
}

void watchdog_feed() { wdt_reset(); }

}  // namespace hal

// Registers of the interrupts, as in step_interrupts.cpp; flags stay as they are.
ISR(WDT_vect, ISR_NAKED) {
    __asm__ __volatile__(
        R"(
        movw r4, r30
        ldi  r30, %[stood_still]
        sts  %[trace], r30
        movw r30, r4
        reti
        )" ::[stood_still] "M"(hal::STOOD_STILL & 0xFF),
        [trace] "i"(&hal::trace));
}
