// Start-up of the Uno.

#include <avr/interrupt.h>
#include <avr/io.h>

#include "boot_count.h"
#include "firmware.h"
#include "hal_serial.h"
#include "hal_step_timer.h"

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

int main() {
    const uint32_t boot_count = hal::count_boot();
    hal::step_timer_init();
    planarm::firmware::set_up(boot_count, 0);
    hal::serial_init();
    sei();
    for (;;) planarm::firmware::pass();
}
