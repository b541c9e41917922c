#include <avr/interrupt.h>
#include <avr/io.h>

#include "hal_pins.h"
#include "polarity.h"

// ENABLE is D8 (PB0); the stop input is A0 (PC0), the limit switches are A1 and A2 (PC1, PC2), all with
// pull-ups.

namespace hal {

namespace {
bool enable_active_high;
}

void set_enable_active_high(bool active_high) {
    enable_active_high = active_high;
    keep_enable_polarity(active_high);
}

void drivers_enable(bool on) {
    if (on == enable_active_high) {
        PORTB |= _BV(PORTB0);
    } else {
        PORTB &= static_cast<uint8_t>(~_BV(PORTB0));
    }
}

uint8_t inputs() {
    const uint8_t pins = PINC;
    uint8_t bits = 0;
    if ((pins & _BV(PINC0)) != 0) bits |= STOP_INPUT_OPEN;
    if ((pins & _BV(PINC1)) == 0) bits |= 0x01;
    if ((pins & _BV(PINC2)) == 0) bits |= 0x02;
    return bits;
}

void watch_stop_input(bool on) {
    PCMSK1 = on ? _BV(PCINT8) : 0;
    PCIFR = _BV(PCIF1);
    PCICR = on ? _BV(PCIE1) : 0;
}

}  // namespace hal
