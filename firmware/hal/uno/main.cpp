// Start-up of the Uno.

#include <avr/interrupt.h>
#include <avr/io.h>

#include "firmware.h"
#include "hal_serial.h"
#include "hal_step_timer.h"
#include "journal.h"
#include "polarity.h"
#include "reset_cause.h"

extern uint8_t reset_flags;

// Runs before main and before memory is set up: drivers released (ENABLE at its level before it becomes an
// output), STEP and DIR low, pull-ups on the inputs, no watchdog left over from before the reset (ATmega328P
// datasheet, 10.9.2).
extern "C" void early_pins() __attribute__((naked, used, section(".init3")));
void early_pins() {
    EEAR = hal::POLARITY_ADDRESS;
    EECR = _BV(EERE);
    if (EEDR != hal::ACTIVE_HIGH) PORTB = _BV(PORTB0);
    DDRB = _BV(DDB0) | _BV(DDB1) | _BV(DDB2);
    PORTD = 0;
    DDRD = _BV(DDD4) | _BV(DDD5);
    PORTC = _BV(PORTC0) | _BV(PORTC1) | _BV(PORTC2);
    reset_flags = MCUSR;
    MCUSR = 0;
    WDTCSR = _BV(WDCE) | _BV(WDE);
    WDTCSR = 0;
}

int main() {
    const planarm::wire::Reset cause = hal::find_reset_cause();
    const hal::JournalBoot journal = hal::journal_boot();
    hal::step_timer_init();
    planarm::firmware::set_up({journal.count, cause, journal.was_enabled}, 0);
    hal::serial_init();
    hal::watchdog_start();
    sei();
    for (;;) planarm::firmware::pass();
}
