// The drivers' common pin and the inputs. STEP and DIR are in hal_step_timer.h, which each board has of its
// own.
#pragma once

#include <stdint.h>

namespace hal {

// ENABLE is active low until told otherwise; outlives a reset. Releases the drivers.
void set_enable_active_high(bool active_high);

// Energises or releases the drivers.
void drivers_enable(bool on);

// Bit j: the limit switch of joint j closes its contact to ground. Bit 7: the stop input is open.
constexpr uint8_t STOP_INPUT_OPEN = 0x80;
uint8_t inputs();

// Lets the stop input's own interrupt end all pulses, as an emergency byte does.
void watch_stop_input(bool on);

}  // namespace hal
