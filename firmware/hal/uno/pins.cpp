#include <avr/io.h>

#include "hal_pins.h"

namespace hal {

// ENABLE is D8, active low.
void drivers_enable(bool on) {
    if (on) {
        PORTB &= static_cast<uint8_t>(~_BV(PORTB0));
    } else {
        PORTB |= _BV(PORTB0);
    }
}

}  // namespace hal
