// The driver pins. STEP and DIR are in hal_step_timer.h.
#pragma once

#include <avr/io.h>

namespace hal {

// Energises or releases the drivers: ENABLE is D8, active low.
inline void drivers_enable(bool on) {
    if (on) {
        PORTB &= static_cast<uint8_t>(~_BV(PORTB0));
    } else {
        PORTB |= _BV(PORTB0);
    }
}

}  // namespace hal
