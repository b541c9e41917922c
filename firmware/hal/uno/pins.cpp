#include <avr/interrupt.h>
#include <avr/io.h>

#include "hal_pins.h"
#include "joints.h"
#include "polarity.h"
#include "ports.h"
#include "wiring.h"

namespace hal {

namespace wire = planarm::wire;
using planarm::for_each_joint;

namespace {
bool enable_active_high;
}

void drivers_enable(bool on) { write_pin(wire::ENABLE_PIN, on == enable_active_high); }

// The EEPROM may be busy for 3.4 ms: the pin first.
void set_enable_active_high(bool active_high) {
    enable_active_high = active_high;
    drivers_enable(false);
    keep_enable_polarity(active_high);
}

uint8_t inputs() {
    uint8_t bits = read_pin(wire::STOP_PIN) ? STOP_INPUT_OPEN : 0;
    for_each_joint([&](auto joint) {
        if (!read_pin(wire::LIMIT_PINS[joint.NUMBER])) bits |= static_cast<uint8_t>(1 << joint.NUMBER);
    });
    return bits;
}

void watch_stop_input(bool on) {
    static_assert(port_of(wire::STOP_PIN) == Port::C, "PCINT1 watches port C");
    PCMSK1 = on ? mask_of(wire::STOP_PIN) : 0;
    PCIFR = _BV(PCIF1);
    PCICR = on ? _BV(PCIE1) : 0;
}

}  // namespace hal
