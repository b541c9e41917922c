// Start-up of the Uno.

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "firmware.h"
#include "hal_serial.h"
#include "hal_step_timer.h"
#include "journal.h"
#include "polarity.h"
#include "reset_cause.h"

extern uint8_t reset_flags;

namespace {

namespace wire = planarm::wire;

constexpr uint8_t mask_if(hal::Port port, uint8_t pin) {
    return hal::port_of(pin) == port ? hal::mask_of(pin) : 0;
}

constexpr uint8_t outputs_in(hal::Port port) {
    return static_cast<uint8_t>(hal::mask_in(port, wire::STEP_PINS) | hal::mask_in(port, wire::DIR_PINS) |
                                mask_if(port, wire::ENABLE_PIN));
}

constexpr uint8_t pull_ups_in(hal::Port port) {
    return static_cast<uint8_t>(hal::mask_in(port, wire::LIMIT_PINS) | mask_if(port, wire::STOP_PIN));
}

// Computed by the compiler: early_pins runs before tables and the stack are there.
constexpr uint8_t OUTPUTS_B = outputs_in(hal::Port::B);
constexpr uint8_t OUTPUTS_D = outputs_in(hal::Port::D);
static_assert(outputs_in(hal::Port::C) == 0, "port C has inputs only");
static_assert(mask_if(hal::Port::B, wire::ENABLE_PIN) != 0, "port D is written whole after ENABLE");
constexpr uint8_t PULL_UPS_B = pull_ups_in(hal::Port::B);
constexpr uint8_t PULL_UPS_C = pull_ups_in(hal::Port::C);
constexpr uint8_t PULL_UPS_D = pull_ups_in(hal::Port::D);

}  // namespace

// Runs before main and before memory is set up: drivers released (ENABLE at its level before it becomes an
// output), STEP and DIR low, pull-ups on the inputs. The watchdog, which after its own reset runs on with 16
// ms (ATmega328P datasheet, 10.9.2), gets 250 ms twice: interrupt, then reset (10.8.2). A main program that
// goes on within the second leaves its mark: whatever resets the chip next is told as the watchdog, which had
// come. A reset in the middle of a write to the EEPROM leaves open whether that goes on (7.6.3).
extern "C" void early_pins() __attribute__((naked, used, section(".init3")));
void early_pins() {
    while ((EECR & _BV(EEPE)) != 0) {
    }
    EEAR = hal::POLARITY_ADDRESS;
    EECR = _BV(EERE);
    if (EEDR != hal::ACTIVE_HIGH) hal::write_pin(wire::ENABLE_PIN, true);
    DDRB = OUTPUTS_B;
    PORTD = PULL_UPS_D;
    DDRD = OUTPUTS_D;
    if (PULL_UPS_B != 0) PORTB = static_cast<uint8_t>(PORTB | PULL_UPS_B);
    PORTC = PULL_UPS_C;
    reset_flags = MCUSR;
    MCUSR = 0;
    static_assert(wire::WATCHDOG_MS == 250, "WDP2 alone");
    wdt_reset();
    WDTCSR = _BV(WDCE) | _BV(WDE);
    WDTCSR = _BV(WDIE) | _BV(WDE) | _BV(WDP2);
}

namespace {

// Apart from main, whose frame on the stack lies below all others.
[[gnu::noinline]] void start() {
    const planarm::wire::Reset cause = hal::find_reset_cause();
    const hal::JournalBoot journal = hal::journal_boot();
    hal::step_timer_init();
    planarm::firmware::set_up({journal.count, cause, journal.was_enabled}, 0);
    hal::serial_init();
}

}  // namespace

int main() {
    start();
    sei();
    for (;;) planarm::firmware::pass();
}
