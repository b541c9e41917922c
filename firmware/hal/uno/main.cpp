// Start-up of the Uno and the step interrupts.

#include <avr/interrupt.h>
#include <avr/io.h>

#include "boot_count.h"
#include "firmware.h"
#include "hal_serial.h"
#include "hal_step_timer.h"
#include "step_engine.h"

// Runs before main and before memory is set up: drivers released (ENABLE high before it becomes an output),
// STEP and DIR low, no watchdog left over from before the reset (ATmega328P datasheet, 10.9.2).
extern "C" void early_pins() __attribute__((naked, used, section(".init3")));
void early_pins() {
    PORTB = _BV(PORTB0);
    DDRB = _BV(DDB0) | _BV(DDB1) | _BV(DDB2);
    PORTD = 0;
    DDRD = _BV(DDD4) | _BV(DDD5);
    MCUSR = 0;
    WDTCSR = _BV(WDCE) | _BV(WDE);
    WDTCSR = 0;
}

// The step interrupts. Cycles from the match, if nothing else runs, with entry (4) and the jump from the
// vector (3):
//   one step after another   180; the pin falls after 97, the next edge is armed after 117
//   on to the next run       149; 87 and 115, DIR set after 94
//   going idle               121; falls after 78
// The least interval of one joint must cover a receive interrupt in progress (75), the other joint's (180),
// one instruction of the main program after each, the arming (117) and the least low time (32): 410. From one
// run to the next the look at the timer comes after 107 and asks for the DIR setup time (320): 690.
ISR(TIMER1_COMPA_vect) { planarm::step_engine::on_match<0>(); }

ISR(TIMER1_COMPB_vect) { planarm::step_engine::on_match<1>(); }

int main() {
    const uint32_t boot_count = hal::count_boot();
    hal::step_timer_init();
    planarm::firmware::set_up(boot_count, 0);
    hal::serial_init();
    sei();
    for (;;) planarm::firmware::pass();
}
